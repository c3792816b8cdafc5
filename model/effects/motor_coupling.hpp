#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// Motor that turns with two joints, v = dq + ratio dq_k, as on wrists whose gears share a shaft (Staubli TX and RX,
/// PUMA). Its friction and its rotor act on both: on this joint coulomb tanh(v / width) + viscous v + inertia dv/dt, on
/// joint k ratio times that, where the effect stands a second time with 1 / ratio. Of that, viscous dq + inertia ddq is
/// left to the joint's `viscous` and `rotor_inertia`, which could not be told from it; so the three columns here are
/// independent of theirs, and coefficients are those of the motor, >= 0 whatever the ratio's sign. `joint` counts from
/// 1, and its index is limited to the robot's joints; at rest where a host has no peers to show. Joint side of both
/// gearboxes.
struct MotorCoupling {
  static constexpr std::string_view name = "motor_coupling";
  static constexpr std::string_view equation =
      "coulomb tanh((dq + ratio dq_k) / width) + viscous ratio dq_k + inertia ratio ddq_k, k = joint";
  static constexpr bool needs_peers = true;
  static constexpr std::string_view source = "Gautier, Janot, Vandanjon 2013 (Staubli TX40, axes 5 and 6)";
  static constexpr EffectTraits traits{.words = "two motors drive this joint through a shared gear",
                                       .experiments = {experiments::one_at_a_time},
                                       .identified = 1};
  static constexpr std::array shape{
      ParameterInfo{"joint", "-", "-", 1, 32, Quantity::count, "index of the other joint", shapes::neighbour},
      ParameterInfo{"ratio", "-", "-", -100, 100, Quantity::ratio, source, shapes::direction},
      ParameterInfo{"width", "rad/s", "m/s", 1e-5, 1e3, Quantity::inverse_velocity, source, shapes::width}};
  static constexpr std::array linear{
      ParameterInfo{"coulomb", "N*m", "N", 0, unbounded, Quantity::unit, source},
      ParameterInfo{"viscous", "N*m*s/rad", "N*s/m", 0, unbounded, Quantity::velocity, source},
      ParameterInfo{"inertia", "kg*m^2", "kg", 0, unbounded, Quantity::acceleration, source}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t i, double value, double) {
    return i == 0 ? value - 1 : (i == 1 ? value : 1 / value);
  }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, NoState&, Saturations&, Emit&& emit) {
    const auto index = split_count(words.template number<Quantity::count>(0)).whole;
    const auto joints = static_cast<std::uint32_t>(u.peers.size());
    const JointInput<N> nobody{};
    const JointInput<N>& peer = joints == 0 ? nobody : u.peers[index < joints ? index : joints - 1];
    const auto ratio = words.template number<Quantity::ratio>(1);
    const auto inverse_width = words.template number<Quantity::inverse_velocity>(2);
    const auto dq = N::template proven_narrow<Velocity<N>>(ratio * peer.dq);
    const auto v = N::template proven_narrow<Velocity<N>>(u.dq + dq);
    emit(as<Quantity::unit>, 0, tanh_of(N::template clamp<Argument<N>>(v * inverse_width)));
    emit(as<Quantity::velocity>, 1, dq);
    emit(as<Quantity::acceleration>, 2, N::template proven_narrow<Acceleration<N>>(ratio * peer.ddq));
  }
};

}  // namespace fxdyn
