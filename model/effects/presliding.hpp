#pragma once

#include "model/effects/dahl.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// Presliding: friction follows the Dahl state z instead of the Coulomb sign, tau = amplitude * (z - s). With amplitude
/// equal to Coulomb's, friction is amplitude * z: it builds up over `distance` after each reversal, milliradians in
/// gears and bearings. Joint side of the gearbox.
struct Presliding {
  static constexpr std::string_view name = "presliding";
  static constexpr std::string_view equation = "amplitude (z - s), dz/dt = dq / distance (1 - sign(dq) z)";
  static constexpr EffectTraits traits{
      .words = "friction builds up over a short path after a reversal, as contacts bend before they slide",
      .experiments = {experiments::small_reversals},
      .friction = true,
      .identified = 3,
      .replaces = "coulomb"};
  static constexpr std::array shape{ParameterInfo{"distance", "rad", "m", 1e-7, 0.03, Quantity::inverse_path,
                                                  "Dahl 1968; Han, Wu, Hui 2025, Eq. 20", shapes::distance}};
  static constexpr std::array linear{
      ParameterInfo{"amplitude", "N*m", "N", 0, unbounded, Quantity::unit, "Han, Wu, Hui 2025, Eq. 20"}};
  template <class N>
  using State = Dahl<N>;
  static constexpr double stored_shape(std::size_t, double distance, double tick_s) { return tick_s / distance; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, Dahl<N>& state, Saturations& saturations,
                              Emit&& emit) {
    const auto z = state.step(u.dq, words.template number<Quantity::inverse_path>(0), saturations);
    // 2 itself is just outside the format
    emit(as<Quantity::unit>, 0, N::template clamp<Unit<N>>(z - u.sign));
  }
};

}  // namespace fxdyn
