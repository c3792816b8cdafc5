#pragma once

#include <Eigen/Dense>
#include <cmath>

namespace fxdyn {

/// How many whole steps fit into a time, given as time over step. A ratio that only the rounding of time stamps keeps
/// from a whole number (they count from 1970 in some logs) is that number.
inline constexpr double rounding_of_stamps = 1e-6;
inline Eigen::Index whole(double ratio) {
  return static_cast<Eigen::Index>(std::floor(ratio * (1 + rounding_of_stamps)));
}
/// How many steps cover it.
inline Eigen::Index whole_up(double ratio) {
  return static_cast<Eigen::Index>(std::ceil(ratio * (1 - rounding_of_stamps)));
}

}  // namespace fxdyn
