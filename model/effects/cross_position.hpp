#pragma once

#include "model/effects/curve.hpp"

namespace fxdyn {

/// A torque over another joint's position that has no name: a cable or hose that joint k winds, a spring across two
/// joints. tau = curve(q_k), k = joint, a cubic B-spline (model/effects/curve.hpp) between from and from + span of that
/// joint, constant beyond. `joint` counts from 1, and its index is limited to the robot's joints; a position of zero
/// where a host has no peers to show. Torque on this joint's side of its gearbox, position on the other joint's side.
struct CrossPosition {
  static constexpr std::string_view name = "cross_position";
  static constexpr std::string_view equation = "curve(q_k), k = joint";
  static constexpr bool needs_peers = true;
  static constexpr EffectTraits traits{.words = "a torque over another joint's position: a cable, a hose",
                                       .experiments = {experiments::one_at_a_time, experiments::wide_range},
                                       .curve = true};
  static constexpr std::array shape = [] {
    constexpr std::string_view of_other = "rad or m";  // of joint k, whichever type that is
    const auto knots = curve_shape(of_other, of_other, 1e3, Quantity::position, Quantity::inverse_position,
                                   shapes::curve_from, shapes::curve_span);
    const ParameterInfo joint{
        "joint", "-", "-", 1, 32, Quantity::count, "index of the other joint", shapes::other_joint};
    return std::array{joint, knots[0], knots[1]};
  }();
  static constexpr std::array linear = curve_linear();
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t i, double value, double) {
    return i == 0 ? value - 1 : stored_curve_shape(i - 1, value);
  }

  template <class N>
  static constexpr Curve<N> curve(const JointInput<N>& u, Words<N> words) {
    const auto index = split_count(words.template number<Quantity::count>(0)).whole;
    const auto joints = static_cast<std::uint32_t>(u.peers.size());
    const Position<N> q = joints == 0 ? Position<N>{} : u.peers[index < joints ? index : joints - 1].q;
    return Curve<N>::at(place_on_curve<N, Quantity::position, Quantity::inverse_position>(q, {words.data + 1}));
  }
  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, NoState&, Saturations&, Emit&& emit) {
    curve<N>(u, words).each(emit);
  }
  template <class N>
  static constexpr auto sum(const JointInput<N>& u, Words<N> words, NoState&, Saturations&) {
    return curve<N>(u, words).sum({words.data + shape.size()});
  }
};

}  // namespace fxdyn
