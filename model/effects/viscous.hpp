#pragma once

#include "model/effect.hpp"

namespace fxdyn {

/// Viscous friction, tau = coefficient * dq. Joint side of the gearbox.
struct Viscous {
  static constexpr std::string_view name = "viscous";
  static constexpr std::string_view equation = "coefficient dq";
  static constexpr EffectTraits traits{
      .words = "friction in proportion to the speed",
      .experiments = {experiments::constant_speeds, experiments::loaded_poses, experiments::warm_robot},
      .nominal = true,
      .friction = true};
  static constexpr std::array<ParameterInfo, 0> shape{};
  static constexpr std::array linear{ParameterInfo{"coefficient", "N*m*s/rad", "N*s/m", 0, unbounded,
                                                   Quantity::velocity,
                                                   "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Eq. 1"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double value, double) { return value; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N>, NoState&, Saturations&, Emit&& emit) {
    emit(as<Quantity::velocity>, 0, u.dq);
  }
};

}  // namespace fxdyn
