#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "model/effects/bristle.hpp"
#include "model/effects/dahl.hpp"

// What the nodes of a joint's Broad Learning System see: one of these sets, each an even number of inputs in [-1, 1].
// `shape` names the quantities of a set's words in the tables, `stored()` their values, `values()` computes the inputs.

namespace fxdyn {

/// What the inputs are scaled by, as the host keeps it. A set reads what it needs.
struct BroadLearningScales {
  double reference_velocity = 1;                      ///< input asinh(dq / reference) / span [rad/s | m/s]
  double span = 6;                                    ///< asinh at the largest velocity, at least 1 [-]
  std::array<double, 3> distances{1e-3, 3e-3, 9e-3};  ///< presliding distances of the Dahl states [rad | m]
  double torque = 1;                                  ///< rigid-body torque that counts as 1 [N*m | N]
  double wavenumber = 1;                              ///< n of sin(n q) and cos(n q) [rad^-1 | m^-1]
  double velocity = 1;                                ///< velocity that counts as 1 [rad/s | m/s]
  double acceleration = 1;                            ///< likewise, above 1/16 [rad/s^2 | m/s^2]
  double middle = 0, half_range = 1;                  ///< position that counts as 0; as 1, from there [rad | m]
  double stribeck = 0.02;                             ///< Stribeck velocity of the bristles [rad/s | m/s]
  double share = 0.7;                                 ///< Coulomb's of static friction, Fc / Fs [-]
};

/// A number as an input: 16 bits, saturated at +-1.
template <class N>
constexpr Feature<N> as_feature(Unit<N> x) {
  return N::feature(x * N::one());
}
/// dq on a scale that is fine near zero, asinh(dq / reference velocity) / span: two words from `at` on.
template <class N>
constexpr Feature<N> curved_velocity(Velocity<N> dq, Words<N> words, std::size_t at) {
  const auto ratio = N::template clamp<Ratio<N>>(dq * words.template number<Quantity::inverse_velocity>(at));
  return N::feature(asinh_of(ratio) * words.template number<Quantity::unit>(at + 1));
}

/// What a friction force depends on: the velocity, and where the joint came from.
///   u = [asinh(dq / reference velocity) / span, z_1, z_2, z_3]    z: Dahl states of three presliding distances
struct PhysicalInputs {
  static constexpr std::string_view name = "physical";
  static constexpr std::size_t size = 4, distances = 3;
  static constexpr std::array shape{Quantity::inverse_velocity, Quantity::unit, Quantity::inverse_path,
                                    Quantity::inverse_path, Quantity::inverse_path};
  static constexpr bool needs_structural = false;

  template <class N>
  struct State {
    std::array<Dahl<N>, distances> dahl{};
  };
  static constexpr std::array<double, shape.size()> stored(const BroadLearningScales& s, double tick_s) {
    return {1 / s.reference_velocity, 1 / s.span, tick_s / s.distances[0], tick_s / s.distances[1],
            tick_s / s.distances[2]};
  }
  template <class N>
  static constexpr std::array<Feature<N>, size> values(const JointInput<N>& joint, Words<N> words, State<N>& state,
                                                       Saturations& saturations) {
    std::array<Feature<N>, size> u{};
    u[0] = curved_velocity<N>(joint.dq, words, 0);
    for (std::size_t i = 1; i < size; ++i) {
      const auto z =
          state.dahl[i - 1].step(joint.dq, words.template number<Quantity::inverse_path>(1 + i), saturations);
      u[i] = as_feature<N>(z);
    }
    return u;
  }
};

/// What LuGre friction depends on: Dahl's states, but of bristles that slide more easily the faster they do; how fast
/// the middle one bends; and how much of static friction is there.
///   u = [asinh(dq / reference velocity) / span, y_1, y_2, y_3, distance_2 dy_2/dt / velocity, 2 bell - 1]
///   bell = exp(-(dq / stribeck)^2)
struct BristlesInputs {
  static constexpr std::string_view name = "bristles";
  static constexpr std::size_t size = 6, distances = 3;
  static constexpr std::array shape{Quantity::inverse_velocity,
                                    Quantity::unit,
                                    Quantity::inverse_path,
                                    Quantity::inverse_path,
                                    Quantity::inverse_path,
                                    Quantity::inverse_velocity,
                                    Quantity::unit,
                                    Quantity::inverse_velocity};
  static constexpr bool needs_structural = false;

  template <class N>
  struct State {
    std::array<Bristle<N>, distances> bristles{};
    Velocity<N> dq{};  ///< of the tick before
  };
  static constexpr std::array<double, shape.size()> stored(const BroadLearningScales& s, double tick_s) {
    const auto physical = PhysicalInputs::stored(s, tick_s);
    std::array<double, shape.size()> out{};
    for (std::size_t i = 0; i < physical.size(); ++i) out[i] = physical[i];
    out[5] = 1 / s.stribeck;
    out[6] = 1 - s.share;
    out[7] = 1 / s.velocity;
    return out;
  }
  template <class N>
  static constexpr std::array<Feature<N>, size> values(const JointInput<N>& joint, Words<N> words, State<N>& state,
                                                       Saturations&) {
    const auto level = SlidingLevel<N>::at(joint.dq, words.template number<Quantity::inverse_velocity>(5),
                                           words.template number<Quantity::unit>(6));
    const auto way = joint.dq + state.dq;
    state.dq = joint.dq;
    std::array<Feature<N>, size> u{};
    u[0] = curved_velocity<N>(joint.dq, words, 0);
    for (std::size_t i = 0; i < distances; ++i) {
      state.bristles[i].step(way, words.template number<Quantity::inverse_path>(2 + i), level);
      u[1 + i] = as_feature<N>(state.bristles[i].y);
    }
    const auto rate = state.bristles[1].rate(joint.dq, level);
    const auto rest = N::template proven_narrow<Unit<N>>(N::one() - level.bell);
    u[4] = N::feature(rate * words.template number<Quantity::inverse_velocity>(7));
    u[5] = as_feature<N>(N::template proven_narrow<Unit<N>>(level.bell - rest));
    return u;
  }
};

/// Beside those what else a gear's losses may depend on: load, angle, acceleration.
///   u = [physical inputs, structural torque / torque, sin(n q), cos(n q), ddq / acceleration]
/// The reciprocal of `acceleration` has the format of an argument, [-16, 16): no quantity has its unit.
struct ExtendedInputs {
  static constexpr std::string_view name = "extended";
  static constexpr std::size_t size = PhysicalInputs::size + 4, first = PhysicalInputs::shape.size();
  static constexpr std::array shape{Quantity::inverse_velocity, Quantity::unit,         Quantity::inverse_path,
                                    Quantity::inverse_path,     Quantity::inverse_path, Quantity::inverse_torque,
                                    Quantity::inverse_position, Quantity::argument};
  static constexpr bool needs_structural = true;

  template <class N>
  using State = PhysicalInputs::State<N>;
  static constexpr std::array<double, shape.size()> stored(const BroadLearningScales& s, double tick_s) {
    const auto physical = PhysicalInputs::stored(s, tick_s);
    std::array<double, shape.size()> out{};
    for (std::size_t i = 0; i < first; ++i) out[i] = physical[i];
    out[first] = 1 / s.torque;
    out[first + 1] = s.wavenumber / (2 * raw::pi);  // turns, as ripple stores it
    out[first + 2] = 1 / s.acceleration;
    return out;
  }
  template <class N>
  static constexpr std::array<Feature<N>, size> values(const JointInput<N>& joint, Words<N> words, State<N>& state,
                                                       Saturations& saturations) {
    const auto physical = PhysicalInputs::values<N>(joint, words, state, saturations);
    const auto wave = sin_cos_turns(joint.q * words.template number<Quantity::inverse_position>(first + 1));
    std::array<Feature<N>, size> u{};
    for (std::size_t i = 0; i < physical.size(); ++i) u[i] = physical[i];
    u[4] = N::feature(joint.structural * words.template number<Quantity::inverse_torque>(first));
    u[5] = as_feature<N>(wave.sine);
    u[6] = as_feature<N>(wave.cosine);
    u[7] = N::feature(joint.ddq * words.template number<Quantity::argument>(first + 2));
    return u;
  }
};

/// The paper's x = [q, dq, ddq] (Eq. 22), without memory, each over half its range; and, as inputs come in pairs, the
/// velocity once more on its curved scale.
struct StateInputs {
  static constexpr std::string_view name = "state";
  static constexpr std::size_t size = 4;
  static constexpr std::array shape{Quantity::position, Quantity::inverse_position, Quantity::inverse_velocity,
                                    Quantity::argument, Quantity::inverse_velocity, Quantity::unit};
  static constexpr bool needs_structural = false;

  template <class N>
  using State = NoState;
  static constexpr std::array<double, shape.size()> stored(const BroadLearningScales& s, double) {
    return {s.middle, 1 / s.half_range, 1 / s.velocity, 1 / s.acceleration, 1 / s.reference_velocity, 1 / s.span};
  }
  template <class N>
  static constexpr std::array<Feature<N>, size> values(const JointInput<N>& joint, Words<N> words, NoState&,
                                                       Saturations&) {
    const auto from_middle =
        N::template proven_narrow<Position<N>>(joint.q - words.template number<Quantity::position>(0));
    return {N::feature(from_middle * words.template number<Quantity::inverse_position>(1)),
            N::feature(joint.dq * words.template number<Quantity::inverse_velocity>(2)),
            N::feature(joint.ddq * words.template number<Quantity::argument>(3)),
            curved_velocity<N>(joint.dq, words, 4)};
  }
};

}  // namespace fxdyn
