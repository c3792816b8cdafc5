#pragma once

#include "model/effect.hpp"

namespace fxdyn {

/// Coulomb friction, tau = amplitude * s with s = tanh(dq / width); the width belongs to the joint (JointInput::sign),
/// since every direction-dependent effect shares it. Joint side of the gearbox.
struct Coulomb {
  static constexpr std::string_view name = "coulomb";
  static constexpr std::string_view equation = "amplitude s, s = tanh(dq / width)";
  static constexpr EffectTraits traits{.words = "dry friction: the same at every speed, against the motion",
                                       .experiments = {experiments::small_reversals, experiments::loaded_poses,
                                                       experiments::constant_speeds, experiments::warm_robot},
                                       .nominal = true,
                                       .friction = true,
                                       .has_sign_width = true,
                                       .turns_with_sign = TurnsWithSign::amplitude};
  static constexpr std::array<ParameterInfo, 0> shape{};
  static constexpr std::array linear{ParameterInfo{"amplitude", "N*m", "N", 0, unbounded, Quantity::unit,
                                                   "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, Eq. 1"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double value, double) { return value; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N>, NoState&, Saturations&, Emit&& emit) {
    emit(as<Quantity::unit>, 0, u.sign);
  }
};

}  // namespace fxdyn
