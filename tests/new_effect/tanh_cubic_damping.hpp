#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// Friction that lets go at low speed, tau = amplitude * tanh(dq / velocity)^3. Joint side of the gearbox.
struct TanhCubicDamping {
  static constexpr std::string_view name = "tanh_cubic_damping";
  static constexpr std::string_view equation = "amplitude tanh(dq / velocity)^3";
  static constexpr EffectTraits traits{.words = "friction that lets go at low speed, and stays the same at high speed",
                                       .experiments = {experiments::constant_speeds, experiments::small_reversals},
                                       .friction = true};
  static constexpr std::array shape{ParameterInfo{"velocity", "rad/s", "m/s", 1e-5, 1e3, Quantity::inverse_velocity,
                                                  "made up for this test", shapes::velocity}};
  static constexpr std::array linear{
      ParameterInfo{"amplitude", "N*m", "N", 0, unbounded, Quantity::unit, "made up for this test"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double velocity, double) { return 1 / velocity; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, NoState&, Saturations&, Emit&& emit) {
    const auto t = tanh_of(N::template clamp<Argument<N>>(u.dq * words.template number<Quantity::inverse_velocity>(0)));
    const auto square = N::template proven_narrow<Unit<N>>(t * t);
    emit(as<Quantity::unit>, 0, N::template proven_narrow<Unit<N>>(square * t));
  }
};

}  // namespace fxdyn
