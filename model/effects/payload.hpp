#pragma once

#include "model/effect.hpp"
#include "model/rigid_body.hpp"

namespace fxdyn {

/// A load in the gripper, a point mass at `com` in the frame of the last link: it adds m, h = m c and J = m c c^T to
/// that link (an extended load adds its own second moments, which little motion excites). Not a joint's effect: the
/// exported inertia contains it.
struct Payload {
  static constexpr std::string_view name = "payload";
  static constexpr std::string_view equation = "last link: m += mass, h += mass com, J += mass com com^T";
  static constexpr ActsOn acts_on = ActsOn::body;
  static constexpr EffectTraits traits{.words = "a load in the gripper", .experiments = {experiments::all_poses}};
  static constexpr std::array<ParameterInfo, 0> shape{};
  // The quantities are not used: nothing of it is stored in tables.
  static constexpr std::array linear{
      ParameterInfo{"mass", "kg", "kg", 0, unbounded, Quantity::unit, "Khalil, Gautier, Lemoine 2007"},
      ParameterInfo{"com_x", "m", "m", -10, 10, Quantity::length, "Khalil, Gautier, Lemoine 2007"},
      ParameterInfo{"com_y", "m", "m", -10, 10, Quantity::length, "Khalil, Gautier, Lemoine 2007"},
      ParameterInfo{"com_z", "m", "m", -10, 10, Quantity::length, "Khalil, Gautier, Lemoine 2007"}};

  static constexpr LinkInertia<Real> add_to(LinkInertia<Real> link, double mass, const Vector3<double>& com) {
    const Vector3<double> h = scale(mass, com);
    link.m += mass;
    link.h = link.h + h;
    link.xx += h.x * com.x;
    link.yy += h.y * com.y;
    link.zz += h.z * com.z;
    link.xy += h.x * com.y;
    link.xz += h.x * com.z;
    link.yz += h.y * com.z;
    return link;
  }
};

}  // namespace fxdyn
