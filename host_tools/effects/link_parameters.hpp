#pragma once

#include <array>

#include "model/rigid_body.hpp"

namespace fxdyn {

/// The parameters of one link as ten numbers, the order of the regressor's columns.
inline std::array<double, parameters_per_link> to_array(const LinkInertia<Real>& link) {
  return {link.m, link.h.x, link.h.y, link.h.z, link.xx, link.yy, link.zz, link.xy, link.xz, link.yz};
}
inline LinkInertia<Real> to_inertia(const std::array<double, parameters_per_link>& v) {
  return {v[0], {v[1], v[2], v[3]}, v[4], v[5], v[6], v[7], v[8], v[9]};
}

}  // namespace fxdyn
