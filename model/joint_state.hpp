#pragma once

#include <cstdint>

#include "model/effect.hpp"
#include "model/rigid_body.hpp"

// What a tick computes of one joint around its effects: limits, the link's side of a gear that bends, the sum.

namespace fxdyn {

/// The setpoints for which the formats were chosen and the torque that may go out, each [lower, upper].
template <class N>
struct JointLimits {
  Position<N> q_lower{}, q_upper{};
  Velocity<N> dq_lower{}, dq_upper{};
  Acceleration<N> ddq_lower{}, ddq_upper{};
  Torque<N> tau_lower{}, tau_upper{};
};

/// What one joint needs besides the rigid body; the words of its effects stand apart.
template <class N>
struct JointConstants {
  JointLimits<N> limits;
  InverseVelocity<N> inverse_width{};  ///< 1 / width of the Coulomb sign [s/rad | s/m]
};

template <class N>
constexpr JointState<N> limit_setpoint(const JointState<N>& state, const JointLimits<N>& limits,
                                       Saturations& saturations) {
  return {limit(state.q, limits.q_lower, limits.q_upper, saturations),
          limit(state.dq, limits.dq_lower, limits.dq_upper, saturations),
          limit(state.ddq, limits.ddq_lower, limits.ddq_upper, saturations)};
}

/// The input of a joint's effects, without torques and peers.
template <class N>
constexpr JointInput<N> joint_input(const JointState<N>& joint, const JointConstants<N>& constants) {
  return {joint.q, joint.dq, joint.ddq, tanh_of(N::template clamp<Argument<N>>(joint.dq * constants.inverse_width))};
}

/// The link's side of a joint whose motor and link differ by a deflection delta: q - delta and, with the differences of
/// delta from tick to tick, its derivatives, within the joint's limits. Zero derivatives in the first tick.
/// Setpoints that jump saturate the differences, which is counted.
template <class N>
struct Deflection {
  /// Ticks in a row that skip() can bridge: beyond, the differences begin anew. Extrapolated by constant
  /// acceleration the error grows with the cube of the ticks; three of them are 6 ms at 2 ms.
  static constexpr std::uint32_t most_skipped = 3;

  Position<N> delta{};
  Position<N> change{}, change_before{};  ///< of delta over the last tick and the one before
  Velocity<N> rate{};
  std::uint32_t ticks = 0;  ///< since the start or the last skip(), which counts as 2; up to 4

  /// @param per_second 1 / tick [1/s]
  constexpr JointState<N> step(const JointState<N>& motor, typename N::DeflectionSum sum, Count<N> per_second,
                               const JointLimits<N>& limits, Saturations& saturations) {
    const auto now = N::template narrow_counted<Position<N>>(sum, saturations);
    const auto change_now = N::template narrow_counted<Position<N>>(now - delta, saturations);
    const auto speed = N::template narrow_counted<Velocity<N>>(change_now * per_second, saturations);
    const auto new_rate = select(ticks > 0, speed, Velocity<N>{});
    const auto speed_change = N::template narrow_counted<Velocity<N>>(new_rate - rate, saturations);
    const auto push = N::template narrow_counted<Acceleration<N>>(speed_change * per_second, saturations);
    const auto acceleration = select(ticks > 1, push, Acceleration<N>{});
    delta = now;
    change_before = change;
    change = select(ticks > 0, change_now, Position<N>{});
    rate = new_rate;
    ticks += static_cast<std::uint32_t>(ticks < 4);
    return limit_setpoint<N>({N::template narrow_counted<Position<N>>(motor.q - now, saturations),
                              N::template narrow_counted<Velocity<N>>(motor.dq - new_rate, saturations),
                              N::template narrow_counted<Acceleration<N>>(motor.ddq - acceleration, saturations)},
                             limits, saturations);
  }

  /// `times` > 0 ticks in a row without setpoints. Delta goes on with its last acceleration, so that the next step()
  /// differentiates over one tick again: each tick c <- c + (c - c_before), delta <- delta + c. Without it several
  /// ticks' change would count as one tick's, a jump of the rate that the second difference turns into a spike of
  /// torque. The change of a tick after a skipped one makes up for the error of the extrapolation: an acceleration out
  /// of it would multiply that error from gap to gap, so until two changes of their own are known the rate is held.
  constexpr void skip(std::uint32_t times, Count<N> per_second, Saturations& saturations) {
    if (ticks < 3 || times > most_skipped) {
      *this = {};
      return;
    }
    const auto growth =
        select(ticks == 4, N::template narrow<Position<N>>(change - change_before, saturations), Position<N>{});
    for (std::uint32_t i = 0; i < times; ++i) {
      change = N::template narrow<Position<N>>(change + growth, saturations);
      delta = N::template narrow<Position<N>>(delta + change, saturations);
    }
    rate = N::template narrow<Velocity<N>>(change * per_second, saturations);
    ticks = 2;
  }
};

/// Torque of one joint: structural (RNEA) + sum of its effects, within the joint's torque limits [N*m | N].
template <class N>
constexpr Torque<N> joint_feedforward(Torque<N> structural, typename N::TorqueSum effects, const JointLimits<N>& limits,
                                      Saturations& saturations) {
  const auto sum = align(structural, N::no_torque()) + effects;
  return limit(N::template proven_narrow<Torque<N>>(sum), limits.tau_lower, limits.tau_upper, saturations);
}

/// Structural torque plus the effects so far, what `needs_total` asks for.
template <class N>
constexpr Torque<N> running_total(Torque<N> structural, typename N::TorqueSum effects) {
  return N::template proven_narrow<Torque<N>>(align(structural, N::no_torque()) + effects);
}

}  // namespace fxdyn
