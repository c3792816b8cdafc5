#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// Friction of another joint k that this joint's drive feels, tau = coulomb s_k + viscous dq_k: wrists whose gears
/// share a shaft. `joint` counts from 1, and its index is limited to the robot's joints; zero where a host has no peers
/// to show. Joint side of both gearboxes.
struct JointCoupling {
  static constexpr std::string_view name = "joint_coupling";
  static constexpr std::string_view equation = "coulomb s_k + viscous dq_k, k = joint";
  static constexpr bool needs_peers = true;
  static constexpr EffectTraits traits{.words = "the friction of another joint is felt here",
                                       .experiments = {experiments::one_at_a_time},
                                       .several = true,
                                       .changes_by_one_more = true};
  static constexpr std::array shape{
      ParameterInfo{"joint", "-", "-", 1, 32, Quantity::count, "index of the other joint", shapes::other_joint}};
  static constexpr std::array linear{
      ParameterInfo{"coulomb", "N*m", "N", -unbounded, unbounded, Quantity::unit,
                    "Gautier, Janot, Vandanjon 2013 (Staubli TX40, axes 5 and 6)"},
      ParameterInfo{"viscous", "N*m*s/rad", "N*s/m", -unbounded, unbounded, Quantity::velocity,
                    "Gautier, Janot, Vandanjon 2013 (Staubli TX40, axes 5 and 6)"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double joint, double) { return joint - 1; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, NoState&, Saturations&, Emit&& emit) {
    const auto index = split_count(words.template number<Quantity::count>(0)).whole;
    const auto joints = static_cast<std::uint32_t>(u.peers.size());
    const JointInput<N> nobody{};
    const JointInput<N>& peer = joints == 0 ? nobody : u.peers[index < joints ? index : joints - 1];
    emit(as<Quantity::unit>, 0, peer.sign);
    emit(as<Quantity::velocity>, 1, peer.dq);
  }
};

}  // namespace fxdyn
