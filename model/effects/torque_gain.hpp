#pragma once

#include "model/effect.hpp"

namespace fxdyn {

/// Error of the drive's torque constant, tau = gain * total: the drive gives (1 + gain) times the torque that the model
/// says. `total` is the structural torque plus the effects before this one. Joint side of the gearbox.
struct TorqueGain {
  static constexpr std::string_view name = "torque_gain";
  static constexpr std::string_view equation = "gain total";
  static constexpr bool needs_total = true;
  static constexpr EffectTraits traits{.words = "the drive's torque is not what it says by a factor",
                                       .experiments = {experiments::loaded_poses, experiments::warm_robot},
                                       .changes_by_one_more = true,
                                       .of_total = OfTotal::scales};
  static constexpr std::array<ParameterInfo, 0> shape{};
  static constexpr std::array linear{ParameterInfo{"gain", "-", "-", -0.9, 10, Quantity::torque,
                                                   "Gautier, Briot 2014 (global identification of joint drive gains)"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double value, double) { return value; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N>, NoState&, Saturations&, Emit&& emit) {
    emit(as<Quantity::torque>, 0, u.total);
  }
};

}  // namespace fxdyn
