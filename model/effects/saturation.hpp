#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// Current limit of the drive, tau = share * (clip(total, +-limit) - total): what the drive can't give. `total` is the
/// structural torque plus the effects before this one; share is 1; a fit that gives another value says that it is
/// something else. Joint side of the gearbox.
struct Saturation {
  static constexpr std::string_view name = "saturation";
  static constexpr std::string_view equation = "share (clip(total, +-limit) - total)";
  static constexpr bool needs_total = true;
  static constexpr EffectTraits traits{.words = "the drive is at its current limit",
                                       .experiments = {experiments::loaded_poses, experiments::constant_speeds},
                                       .share = true,
                                       .of_total = OfTotal::clips};
  static constexpr std::array shape{ParameterInfo{"limit", "N*m", "N", 0, unbounded, Quantity::torque,
                                                  "current limit of a drive", shapes::torque_limit}};
  static constexpr std::array linear{ParameterInfo{"share", "-", "-", 0, 2, Quantity::torque, "1 by definition"}};
  template <class N>
  using State = NoState;
  static constexpr double stored_shape(std::size_t, double value, double) { return value; }

  template <class N, class Emit>
  static constexpr void basis(const JointInput<N>& u, Words<N> words, NoState&, Saturations&, Emit&& emit) {
    emit(as<Quantity::torque>, 0, clipping(u.total, words.template number<Quantity::torque>(0)));
  }
};

}  // namespace fxdyn
