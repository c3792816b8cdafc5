#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <utility>

#include "model/broad_learning.hpp"
#include "model/catalogue.hpp"
#include "model/rigid_body.hpp"
#include "model/table_page.hpp"

// Composition: rigid body + effects of every joint = the feedforward torque of one tick.

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

namespace detail {
/// x within [lower, upper]; counts when it was not.
template <class T>
constexpr T limit(T x, T lower, T upper, Saturations& saturations) {
  const bool below = x<lower, above = x> upper;
  saturations.count += static_cast<std::uint32_t>(below) + static_cast<std::uint32_t>(above);
  return below ? lower : (above ? upper : x);
}
}  // namespace detail

template <class N>
constexpr JointState<N> limit_setpoint(const JointState<N>& state, const JointLimits<N>& limits,
                                       Saturations& saturations) {
  return {detail::limit(state.q, limits.q_lower, limits.q_upper, saturations),
          detail::limit(state.dq, limits.dq_lower, limits.dq_upper, saturations),
          detail::limit(state.ddq, limits.ddq_lower, limits.ddq_upper, saturations)};
}

/// Torque of one joint: structural (RNEA) + sum of its effects, within the joint's torque limits [N*m | N].
/// `contributions(u)` returns that sum as N::TorqueSum.
template <class N, class Contributions>
constexpr Torque<N> joint_feedforward(const JointState<N>& joint, Torque<N> structural,
                                      const JointConstants<N>& constants, Contributions&& contributions,
                                      Saturations& saturations) {
  JointInput<N> u{joint.q, joint.dq, joint.ddq, {}, structural};
  u.sign = tanh_of(N::template clamp<Argument<N>>(joint.dq * constants.inverse_width));
  const auto sum = align(structural, N::no_torque()) + contributions(u);
  return detail::limit(N::template narrow<Torque<N>>(sum, saturations), constants.limits.tau_lower,
                       constants.limits.tau_upper, saturations);
}

/// The effects of one joint, in the order of their words in the tables.
template <class... Effects>
struct JointEffects {
  static constexpr std::size_t words = (0 + ... + (Effects::shape.size() + Effects::linear.size()));
  template <class N>
  using State = std::tuple<typename Effects::template State<N>...>;

  template <class N>
  static constexpr typename N::TorqueSum sum(const JointInput<N>& u, const typename N::Word* data, State<N>& state,
                                             Saturations& saturations) {
    return sum_each<N>(u, data, state, saturations, std::index_sequence_for<Effects...>{});
  }
  static constexpr void hash(LayoutHash& hash) {
    hash.add(static_cast<std::int32_t>(sizeof...(Effects)));
    ((hash.add(Effects::name), hash.add(static_cast<std::int32_t>(Effects::shape.size() + Effects::linear.size()))),
     ...);
  }

 private:
  template <class N, std::size_t... i>
  static constexpr typename N::TorqueSum sum_each(const JointInput<N>& u, const typename N::Word* data, State<N>& state,
                                                  Saturations& saturations, std::index_sequence<i...>) {
    auto total = N::no_torque();
    ((total = total + contribution<Effects, N>(u, Words<N>{data}, std::get<i>(state), saturations),
      data += Effects::shape.size() + Effects::linear.size()),
     ...);
    return total;
  }
};

/// A robot's feedforward model with everything static: number system, joints, effects. `Joints` are JointEffects.
template <class N, class... Joints>
struct RobotModel {
  using Numbers = N;
  static constexpr std::size_t joints = sizeof...(Joints);
  static constexpr std::size_t effect_words = (0 + ... + Joints::words);

  /// In flash. Only 32-bit words on a target.
  struct Parameters {
    Vector3<LinearAcceleration<N>> up;
    std::array<LinkGeometry<N>, joints> geometry;
    std::array<LinkInertia<N>, joints> inertia;
    std::array<JointConstants<N>, joints> constants;
    std::array<typename N::Word, effect_words> words;
  };
  /// What effects remember; value-initialised: the robot at rest.
  struct State {
    std::tuple<typename Joints::template State<N>...> effects;
  };
  using Inputs = std::array<JointState<N>, joints>;
  using Torques = std::array<Torque<N>, joints>;

  /// One tick: setpoints in, feedforward torques out. Total: whatever comes in is limited, saturated and counted.
  static constexpr Torques tick(const Parameters& parameters, State& state, const Inputs& setpoints,
                                Saturations& saturations) noexcept {
    Inputs limited{};
    for (std::size_t i = 0; i < joints; ++i) {
      limited[i] = limit_setpoint<N>(setpoints[i], parameters.constants[i].limits, saturations);
    }
    std::array<LinkMotion<N>, joints> motions{};
    std::array<Wrench<N>, joints> wrenches{};
    Torques structural{};
    rnea<N, joints>(parameters.geometry, parameters.inertia, parameters.up, limited, motions, wrenches, structural,
                    saturations);
    Torques tau{};
    add_effects(parameters, state, limited, structural, tau, saturations, std::index_sequence_for<Joints...>{});
    return tau;
  }

  static constexpr std::uint32_t layout_hash() {
    LayoutHash hash;
    N::hash_formats(hash);
    hash.add(static_cast<std::int32_t>(joints));
    (Joints::hash(hash), ...);
    return hash.value();
  }

 private:
  template <std::size_t... i>
  static constexpr void add_effects(const Parameters& parameters, State& state, const Inputs& limited,
                                    const Torques& structural, Torques& tau, Saturations& saturations,
                                    std::index_sequence<i...>) {
    const typename N::Word* data = parameters.words.data();
    ((tau[i] = joint_feedforward<N>(
          limited[i], structural[i], parameters.constants[i],
          [&](const JointInput<N>& u) {
            return Joints::template sum<N>(u, data, std::get<i>(state.effects), saturations);
          },
          saturations),
      data += Joints::words),
     ...);
  }
};

}  // namespace fxdyn
