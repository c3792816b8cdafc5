#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// Torque that repeats with the position, tau = cos cos(n q) + sin sin(n q), n = wavenumber: cogging, gear mesh,
/// bearing seats. Per motor turn n = gear ratio times an integer. Stored as turns per unit of position, n / (2 pi), so
/// that whole turns drop out without a division. Joint side of the gearbox.
struct Ripple {
  static constexpr std::string_view name = "ripple";
  static constexpr std::string_view equation = "cos cos(wavenumber q) + sin sin(wavenumber q)";
  static constexpr EffectTraits traits{.words = "torque that repeats with the position: cogging, teeth of a gear",
                                       .experiments = {experiments::wide_range, experiments::wide_range_or_baseline},
                                       .several = true,
                                       .changes_by_one_more = true};
  static constexpr std::array shape{ParameterInfo{"wavenumber", "rad^-1", "m^-1", 0.5, 1e5, Quantity::inverse_position,
                                                  "Holtz, Springob 1996", shapes::wavenumber}};
  static constexpr std::array linear{
      ParameterInfo{"cos", "N*m", "N", -unbounded, unbounded, Quantity::unit, "Holtz, Springob 1996"},
      ParameterInfo{"sin", "N*m", "N", -unbounded, unbounded, Quantity::unit, "Holtz, Springob 1996"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double wavenumber, double) {
    return wavenumber * 0.159154943091895336;
  }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, NoState&, Saturations&, Emit&& emit) {
    const auto wave = sin_cos_turns(u.q * words.template number<Quantity::inverse_position>(0));
    emit(as<Quantity::unit>, 0, wave.cosine);
    emit(as<Quantity::unit>, 1, wave.sine);
  }
};

}  // namespace fxdyn
