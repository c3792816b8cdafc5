#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// Elastic gear, delta = compliance * load, load the structural torque behind a damper in parallel with the spring:
/// K delta + B d(delta)/dt = structural, compliance = 1 / K, relaxation = B / K. Stepped by the implicit Euler rule:
/// the load lags a slowly changing torque by the relaxation, whatever the tick, so that a relaxation found at one tick
/// serves at another. Starts in equilibrium. Paper Eq. 12 (its J_eff is the rotor_inertia effect). Acts on the
/// position: the link is at q - delta. Link side of the gearbox, in its angle.
struct Elasticity {
  static constexpr std::string_view name = "elasticity";
  static constexpr std::string_view equation = "delta = compliance load, load + relaxation d(load)/dt = structural";
  static constexpr ActsOn acts_on = ActsOn::position;
  static constexpr bool needs_structural = true;
  static constexpr EffectTraits traits{.words = "the gear bends under its load",
                                       .experiments = {experiments::load_reversals, experiments::fast_motion}};
  static constexpr std::array shape{ParameterInfo{"relaxation", "s", "s", 0, 1, Quantity::unit,
                                                  "Han, Wu, Hui 2025, Eq. 12: B / K", shapes::relaxation}};
  static constexpr std::array linear{ParameterInfo{"compliance", "rad/(N*m)", "m/N", 0, unbounded, Quantity::torque,
                                                   "Han, Wu, Hui 2025, Eq. 12: 1 / K"}};
  template <class N>
  struct State {
    Torque<N> load{}, change{};  ///< and how much the last tick changed it
    std::uint32_t ticks = 0;     ///< 0 or 1: stepped before
  };
  static constexpr double stored_shape(std::size_t, double relaxation, double tick_s) {
    return tick_s / (tick_s + relaxation);
  }

  /// `times` ticks in a row without setpoints: the load goes on as it went.
  template <class N>
  static constexpr void skip(State<N>& state, std::uint32_t times, Saturations& saturations) {
    for (std::uint32_t i = 0; i < times; ++i)
      state.load = N::template narrow<Torque<N>>(state.load + state.change, saturations);
  }
  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, State<N>& state, Saturations& saturations,
                              Emit&& emit) {
    // The first tick takes the torque as it is: no branch, so that every tick costs the same.
    const std::array<Unit<N>, 2> shares{N::one(), words.template number<Quantity::unit>(0)};
    const auto before = state.load;
    state.load = relax<N>(state.load, u.structural, shares[state.ticks]);
    state.change =
        select(state.ticks != 0, N::template narrow<Torque<N>>(state.load - before, saturations), Torque<N>{});
    state.ticks = 1;
    emit(as<Quantity::torque>, 0, state.load);
  }
};

}  // namespace fxdyn
