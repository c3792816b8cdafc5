#pragma once

#include <cmath>

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// Friction that changes while the robot warms up, tau = w (coulomb s + viscous dq), w = 1 - exp(-t / time_constant), t
/// since the start. w is stepped exactly, w <- w + (1 - w) k, with k = 1 - exp(-tick / time_constant) stored to 30
/// bits. So long time constants are coarse in fixed point: k is off by up to 2^-31 / k of itself, and w stops 2^-31 / k
/// short of 1; at 2 ms that is 0.02 % for 1000 s and 0.2 % for 10000 s. Joint side of the gearbox.
struct FrictionDrift {
  static constexpr std::string_view name = "friction_drift";
  static constexpr std::string_view equation = "w (coulomb s + viscous dq), w = 1 - exp(-t / time_constant)";
  static constexpr EffectTraits traits{.words = "friction changes as the robot warms up",
                                       .experiments = {experiments::warm_robot},
                                       .friction = true,
                                       .shortest_session_s = 20,
                                       .warms_into = {"coulomb", "viscous"}};
  static constexpr std::array shape{ParameterInfo{"time_constant", "s", "s", 0.1, 1e4, Quantity::unit,
                                                  "Bittencourt, Gunnarsson 2012 (friction and temperature)",
                                                  shapes::time_constant}};
  static constexpr std::array linear{
      ParameterInfo{"coulomb", "N*m", "N", -unbounded, unbounded, Quantity::unit, "Bittencourt, Gunnarsson 2012"},
      ParameterInfo{"viscous", "N*m*s/rad", "N*s/m", -unbounded, unbounded, Quantity::velocity,
                    "Bittencourt, Gunnarsson 2012"}};
  template <class N>
  struct State {
    Unit<N> w{};
  };
  /// w after a time from the start [s].
  static double warmth(double seconds, double time_constant) { return -std::expm1(-seconds / time_constant); }
  static double stored_shape(std::size_t, double time_constant, double tick_s) { return warmth(tick_s, time_constant); }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, State<N>& state, Saturations&, Emit&& emit) {
    emit(as<Quantity::unit>, 0, N::template proven_narrow<Unit<N>>(state.w * u.sign));
    emit(as<Quantity::velocity>, 1, N::template proven_narrow<Velocity<N>>(state.w * u.dq));
    state.w = relax<N>(state.w, N::one(), words.template number<Quantity::unit>(0));
  }
};

}  // namespace fxdyn
