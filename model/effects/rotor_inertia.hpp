#pragma once

#include "model/effect.hpp"

namespace fxdyn {

/// Inertia of the rotor and the gears in front of the load, tau = inertia * ddq, inertia = gear ratio squared times
/// that of the motor side. Gyroscopic terms of the spinning rotor are left out, as is usual. Joint side of the gearbox.
struct RotorInertia {
  static constexpr std::string_view name = "rotor_inertia";
  static constexpr std::string_view equation = "inertia ddq";
  static constexpr EffectTraits traits{.words = "inertia of rotor and gear in front of the load",
                                       .experiments = {experiments::fast_motion, experiments::hopeless},
                                       .nominal = true,
                                       .in_base = true};
  static constexpr std::array<ParameterInfo, 0> shape{};
  static constexpr std::array linear{ParameterInfo{"inertia", "kg*m^2", "kg", 0, unbounded, Quantity::acceleration,
                                                   "Siciliano, Sciavicco, Villani, Oriolo, Robotics, sec. 7.2"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double value, double) { return value; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N>, NoState&, Saturations&, Emit&& emit) {
    emit(as<Quantity::acceleration>, 0, u.ddq);
  }
};

}  // namespace fxdyn
