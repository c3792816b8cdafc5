#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// A knee within the speeds of the motion: lower ones look like the Coulomb sign, higher ones like cubic friction.
inline constexpr ShapeValues knee{
    .tried = [](const MotionScales& s) { return shapes::geometric(0.1 * s.speed, 0.8 * s.speed, 7); },
    .judged =
        [](const MotionScales& s) {
          return shapes::shares_of(s.speed, {0.3, 0.15, 0.6});
        },
    .fitted =
        [](const MotionScales& s) {
          return ShapeRange{0.1 * s.speed, 0.8 * s.speed};
        }};

/// Friction that lets go at low speed, tau = amplitude * tanh(dq / velocity)^3. Joint side of the gearbox.
struct TanhCubicDamping {
  static constexpr std::string_view name = "tanh_cubic_damping";
  static constexpr std::string_view equation = "amplitude tanh(dq / velocity)^3";
  static constexpr EffectTraits traits{.words = "friction that lets go at low speed, and stays the same at high speed",
                                       .experiments = {experiments::constant_speeds, experiments::small_reversals},
                                       .friction = true};
  static constexpr std::array shape{
      ParameterInfo{"velocity", "rad/s", "m/s", 0.02, 1e3, Quantity::inverse_velocity, "made up for this test", knee}};
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
