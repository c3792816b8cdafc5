#pragma once

#include "model/effect.hpp"

namespace fxdyn {

/// Viscous friction that grows with the square of the speed, tau = coefficient * dq |dq|: churned grease, fans. Joint
/// side of the gearbox.
struct ViscousQuadratic {
  static constexpr std::string_view name = "viscous_quadratic";
  static constexpr std::string_view equation = "coefficient dq |dq|";
  static constexpr EffectTraits traits{
      .words = "friction that grows with the square of the speed: churned grease, fans",
      .experiments = {experiments::constant_speeds},
      .friction = true};
  static constexpr std::array<ParameterInfo, 0> shape{};
  static constexpr std::array linear{
      ParameterInfo{"coefficient", "N*m*s^2/rad^2", "N*s^2/m^2", -unbounded, unbounded, Quantity::velocity_squared,
                    "Waiboer, Aarts, Jonker 2005 (viscous friction nonlinear in speed)"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double value, double) { return value; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N>, NoState&, Saturations&, Emit&& emit) {
    emit(as<Quantity::velocity_squared>, 0, N::template proven_narrow<VelocitySquared<N>>(u.dq * magnitude(u.dq)));
  }
};

}  // namespace fxdyn
