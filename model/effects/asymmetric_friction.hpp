#pragma once

#include "model/effect.hpp"

namespace fxdyn {

/// Friction that differs with the direction, tau = coulomb |s| + viscous |dq| on top of the symmetric coulomb and
/// viscous effects: the coefficients are half the difference between the two directions. Joint side of the gearbox.
struct AsymmetricFriction {
  static constexpr std::string_view name = "asymmetric_friction";
  static constexpr std::string_view equation = "coulomb |s| + viscous |dq|";
  static constexpr EffectTraits traits{.words = "friction that is not the same in both directions",
                                       .experiments = {experiments::slow_reversals},
                                       .friction = true,
                                       .identified = 2};
  static constexpr std::array<ParameterInfo, 0> shape{};
  static constexpr std::array linear{
      ParameterInfo{"coulomb", "N*m", "N", -unbounded, unbounded, Quantity::unit,
                    "Armstrong-Helouvry, Dupont, Canudas de Wit 1994"},
      ParameterInfo{"viscous", "N*m*s/rad", "N*s/m", -unbounded, unbounded, Quantity::velocity,
                    "Armstrong-Helouvry, Dupont, Canudas de Wit 1994"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double value, double) { return value; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N>, NoState&, Saturations&, Emit&& emit) {
    emit(as<Quantity::unit>, 0, magnitude(u.sign));
    emit(as<Quantity::velocity>, 1, magnitude(u.dq));
  }
};

}  // namespace fxdyn
