#pragma once

#include "model/effect.hpp"

namespace fxdyn {

/// Viscous friction with a cubic term, tau = coefficient * dq^3; negative where friction flattens out at high speed.
/// Joint side of the gearbox.
struct ViscousCubic {
  static constexpr std::string_view name = "viscous_cubic";
  static constexpr std::string_view equation = "coefficient dq^3";
  static constexpr EffectTraits traits{.words = "viscous friction that flattens out, or grows steeply, at high speed",
                                       .experiments = {experiments::constant_speeds},
                                       .friction = true};
  static constexpr std::array<ParameterInfo, 0> shape{};
  static constexpr std::array linear{ParameterInfo{"coefficient", "N*m*s^3/rad^3", "N*s^3/m^3", -unbounded, unbounded,
                                                   Quantity::velocity_cubed,
                                                   "Wolf, Iskandar 2018 (nonlinear viscous friction)"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double value, double) { return value; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N>, NoState&, Saturations&, Emit&& emit) {
    const auto square = N::template proven_narrow<VelocitySquared<N>>(u.dq * u.dq);
    emit(as<Quantity::velocity_cubed>, 0, N::template proven_narrow<VelocityCubed<N>>(square * u.dq));
  }
};

}  // namespace fxdyn
