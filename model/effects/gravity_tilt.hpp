#pragma once

#include "model/effect.hpp"
#include "model/vector.hpp"

namespace fxdyn {

/// A base that does not stand as the project says: `up` (minus gravity, in the base frame) is turned about the base's x
/// axis by tilt_x, then about its y axis by tilt_y, exactly: up <- Ry(tilt_y) Rx(tilt_x) up. Not a joint's effect: the
/// exported gravity contains it.
struct GravityTilt {
  static constexpr std::string_view name = "gravity_tilt";
  static constexpr std::string_view equation = "up <- Ry(tilt_y) Rx(tilt_x) up";
  static constexpr ActsOn acts_on = ActsOn::body;
  static constexpr EffectTraits traits{.words = "the base does not stand upright",
                                       .experiments = {experiments::all_poses}};
  static constexpr std::array<ParameterInfo, 0> shape{};
  // The quantities are not used: nothing of it is stored in tables.
  static constexpr std::array linear{
      ParameterInfo{"tilt_x", "rad", "rad", -0.5, 0.5, Quantity::position, "rotation of the base"},
      ParameterInfo{"tilt_y", "rad", "rad", -0.5, 0.5, Quantity::position, "rotation of the base"}};

  static Vector3<double> turn(const Vector3<double>& up, double tilt_x, double tilt_y) {
    const auto x = sin_cos(tilt_x), y = sin_cos(tilt_y);
    const double y1 = x.cosine * up.y - x.sine * up.z, z1 = x.sine * up.y + x.cosine * up.z;
    return {y.cosine * up.x + y.sine * z1, y1, y.cosine * z1 - y.sine * up.x};
  }
};

}  // namespace fxdyn
