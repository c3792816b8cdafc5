#pragma once

#include <Eigen/Core>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tuple>
#include <utility>

#include "model/broad_learning.hpp"
#include "model/catalogue.hpp"
#include "model/joint_state.hpp"
#include "model/rigid_body.hpp"
#include "model/table_page.hpp"

// Composition: rigid body + effects of every joint = the feedforward torque of one tick.

namespace fxdyn {

/// One joint of a robot: its link's shape and its effects in the order of their words in the tables; effects that need
/// the running total come last.
template <class Link_, class... Effects>
struct JointModel {
  using LinkShape = Link_;
  static constexpr std::size_t words = (0 + ... + words_of<Effects>);
  static constexpr bool deflects = (false || ... || (acts_on<Effects> == ActsOn::position));
  /// By the load: what deflects has to know the torque first.
  static constexpr bool bends = (false || ... || (acts_on<Effects> == ActsOn::position && needs_structural<Effects>));
  static constexpr bool couples = (false || ... || needs_peers<Effects>);
  template <class N>
  using State = std::tuple<typename Effects::template State<N>...>;

  /// Sum of the effects that act on `what`; steps their states.
  template <class N, ActsOn what>
  static constexpr auto sum(JointInput<N> u, const typename N::Word* data, State<N>& state, Saturations& saturations) {
    auto total = [] {
      if constexpr (what == ActsOn::position)
        return N::no_deflection();
      else
        return N::no_torque();
    }();
    [&]<std::size_t... i>(std::index_sequence<i...>) {
      (add<Effects, N, what>(u, data, std::get<i>(state), total, saturations), ...);
    }
    (std::index_sequence_for<Effects...>{});
    return total;
  }
  /// `times` ticks in a row without setpoints, for the effects that have to go on through them.
  template <class N>
  static constexpr void skip(State<N>& state, std::uint32_t times, Saturations& saturations) {
    [&]<std::size_t... i>(std::index_sequence<i...>) {
      (skip_effect<Effects, N>(std::get<i>(state), times, saturations), ...);
    }
    (std::index_sequence_for<Effects...>{});
  }
  static constexpr void hash(LayoutHash& hash) {
    hash.add(LinkShape::code);
    hash.add(static_cast<std::int32_t>(sizeof...(Effects)));
    (hash_effect<Effects>(hash), ...);
  }

 private:
  template <class E>
  static constexpr void hash_effect(LayoutHash& hash) {
    if constexpr (requires { E::hash(hash); }) {
      E::hash(hash);
    } else {
      hash.add(E::name);
      hash.add(static_cast<std::int32_t>(words_of<E>));
    }
  }
  template <class E, class N, class State>
  static constexpr void skip_effect(State& state, std::uint32_t times, Saturations& saturations) {
    if constexpr (requires { E::template skip<N>(state, times, saturations); }) {
      if (times > Deflection<N>::most_skipped) {
        state = {};
      } else {
        E::template skip<N>(state, times, saturations);
      }
    }
  }
  template <class E, class N, ActsOn what, class State, class Sum>
  static constexpr void add(JointInput<N>& u, const typename N::Word*& data, State& state, Sum& total,
                            Saturations& saturations) {
    if constexpr (acts_on<E> == what) {
      if constexpr (needs_total<E>) u.total = running_total<N>(u.structural, total);
      total = total + contribution<E, N>(u, Words<N>{data}, state, saturations);
    }
    data += words_of<E>;
  }
};

/// A robot's feedforward model with everything static: number system, which joints' torques this drive puts out
/// (`outputs`: bit i for joint i+1), and the joints in chain order. RNEA needs the motion of every joint, but wrenches
/// and effects only those of the joints asked for: the rest is not computed.
template <class N, std::uint32_t outputs_, class... Joints>
struct RobotModel {
  using Numbers = N;
  static constexpr std::size_t joints = sizeof...(Joints);
  static_assert(joints <= 32 && outputs_ != 0 && (joints == 32 || outputs_ >> joints == 0));
  static constexpr std::uint32_t outputs_mask = outputs_;
  static constexpr std::size_t outputs = static_cast<std::size_t>(std::popcount(outputs_));
  static constexpr std::size_t effect_words = (0 + ... + Joints::words);
  static constexpr bool deflects = (false || ... || Joints::deflects);
  static constexpr bool bends = (false || ... || Joints::bends);
  static constexpr bool couples = (false || ... || Joints::couples);

  /// In flash. Only 32-bit words on a target.
  struct Parameters {
    Vector3<LinearAcceleration<N>> up;
    Count<N> ticks_per_second;
    std::array<LinkGeometry<N>, joints> geometry;
    std::array<LinkInertia<N>, joints> inertia;
    std::array<JointConstants<N>, joints> constants;
    std::array<typename N::Word, effect_words> words;
  };
  /// What effects remember; value-initialised: the robot at rest.
  struct State {
    std::tuple<typename Joints::template State<N>...> effects;
    std::array<Deflection<N>, deflects ? joints : 0> deflections{};
  };
  template <class T>
  using Column = Eigen::Matrix<T, static_cast<int>(joints), 1>;
  /// q [rad | m], dq, ddq of every joint, in chain order.
  struct Setpoints {
    Column<Position<N>> q;
    Column<Velocity<N>> dq;
    Column<Acceleration<N>> ddq;
  };
  /// Of the joints in `outputs`, in chain order [N*m | N].
  using Torques = Eigen::Matrix<Torque<N>, static_cast<int>(outputs), 1>;

  /// One tick: setpoints in, feedforward torques out. Total: whatever comes in is limited, saturated and counted. The
  /// number of instructions does not depend on the values. The tables may be constants: flash is read all the same.
  static Torques tick(const Parameters& tables, State& state, const Setpoints& setpoints,
                      Saturations& saturations) noexcept {
    const Parameters& parameters = as_flashed(tables);
    std::array<JointState<N>, joints> limited;
    for (std::size_t i = 0; i < joints; ++i) {
      const auto k = static_cast<int>(i);
      limited[i] = limit_setpoint<N>({setpoints.q[k], setpoints.dq[k], setpoints.ddq[k]},
                                     parameters.constants[i].limits, saturations);
    }
    std::array<JointInput<N>, joints> inputs;
    for (std::size_t i = 0; i < joints; ++i) {
      if (couples || deflects || is_output(i)) inputs[i] = joint_input<N>(limited[i], parameters.constants[i]);
      if constexpr (couples) inputs[i].peers = inputs;
    }
    std::array<Torque<N>, joints> structural;
    if constexpr (bends || !deflects) rigid_body<deflects ? 0 : first>(parameters, limited, structural);
    if constexpr (deflects) {
      if constexpr (bends) {
        for (std::size_t i = 0; i < joints; ++i) inputs[i].structural = structural[i];
      }
      each(
          [&]<std::size_t i, class J>(const typename N::Word* data) {
            const auto sum =
                J::template sum<N, ActsOn::position>(inputs[i], data, std::get<i>(state.effects), saturations);
            limited[i] = state.deflections[i].step(limited[i], sum, parameters.ticks_per_second,
                                                   parameters.constants[i].limits, saturations);
          },
          parameters);
      rigid_body<first>(parameters, limited, structural);
    }
    Torques tau;
    int at = 0;
    each(
        [&]<std::size_t i, class J>(const typename N::Word* data) {
          if constexpr (is_output(i)) {
            inputs[i].structural = structural[i];
            const auto sum =
                J::template sum<N, ActsOn::torque>(inputs[i], data, std::get<i>(state.effects), saturations);
            tau[at++] = joint_feedforward<N>(structural[i], sum, parameters.constants[i].limits, saturations);
          }
        },
        parameters);
    return tau;
  }

  /// Ticks that had no setpoints (lost on the bus, say), `times` in a row: call it once before the next tick(), so that
  /// what is differentiated from tick to tick goes on by itself (Deflection::skip). What effects remember stands still
  /// meanwhile: it lags by these ticks, which makes no step.
  static void skip(const Parameters& parameters, State& state, std::uint32_t times, Saturations& saturations) noexcept {
    if constexpr (deflects) {
      if (times == 0) return;
      for (auto& deflection : state.deflections) deflection.skip(times, parameters.ticks_per_second, saturations);
      [&]<std::size_t... j>(std::index_sequence<j...>) {
        (Joints::template skip<N>(std::get<j>(state.effects), times, saturations), ...);
      }
      (std::index_sequence_for<Joints...>{});
    }
  }

  /// Torques of the rigid body for joints `from` .. of states within the limits: the tick's RNEA. One function of its
  /// own, everything inlined: the links' intermediate results stay in registers.
  template <std::size_t from>
  [[gnu::noinline, gnu::flatten]] static void rigid_body(const Parameters& parameters,
                                                         const std::array<JointState<N>, joints>& states,
                                                         std::array<Torque<N>, joints>& structural) {
    rnea_of<N, from, typename Joints::LinkShape...>(parameters.geometry, parameters.inertia, parameters.up, states,
                                                    structural);
  }

  static constexpr std::uint32_t layout_hash() {
    LayoutHash hash;
    N::hash_formats(hash);
    hash.add(static_cast<std::int32_t>(joints));
    hash.add(static_cast<std::int32_t>(outputs_));
    (Joints::hash(hash), ...);
    return hash.value();
  }

 private:
  static constexpr std::size_t first = static_cast<std::size_t>(std::countr_zero(outputs_));
  static constexpr bool is_output(std::size_t i) { return (outputs_ >> i & 1U) != 0; }

  /// Calls visit<i, Joint>(its words) for every joint.
  template <class Visit>
  static constexpr void each(Visit&& visit, const Parameters& parameters) {
    const typename N::Word* data = parameters.words.data();
    [&]<std::size_t... i>(std::index_sequence<i...>) {
      ((visit.template operator()<i, Joints>(data), data += Joints::words), ...);
    }
    (std::index_sequence_for<Joints...>{});
  }
};

}  // namespace fxdyn
