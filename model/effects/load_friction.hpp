#pragma once

#include "model/effect.hpp"

namespace fxdyn {

/// Friction that grows with the load on the gear, tau = coefficient * |structural| s, structural being the rigid-body
/// torque of the tick. Joint side of the gearbox.
struct LoadFriction {
  static constexpr std::string_view name = "load_friction";
  static constexpr std::string_view equation = "coefficient |structural| s";
  static constexpr bool needs_structural = true;
  static constexpr EffectTraits traits{.words = "friction that grows with the load",
                                       .experiments = {experiments::loaded_poses},
                                       .friction = true,
                                       .turns_with_sign = TurnsWithSign::load};
  static constexpr std::array<ParameterInfo, 0> shape{};
  static constexpr std::array linear{
      ParameterInfo{"coefficient", "-", "-", 0, 1, Quantity::torque, "Hamon, Gautier, Garrec, Janot 2010"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double value, double) { return value; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N>, NoState&, Saturations&, Emit&& emit) {
    emit(as<Quantity::torque>, 0, N::template proven_narrow<Torque<N>>(magnitude(u.structural) * u.sign));
  }
};

}  // namespace fxdyn
