#pragma once

#include <Eigen/Dense>
#include <algorithm>

namespace fxdyn {

/// The value that `share` (0 .. 1) of the elements do not exceed; of no interpolation.
inline double quantile(Eigen::VectorXd x, double share) {
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(x.size() - 1));
  std::nth_element(x.begin(), x.begin() + at, x.end());
  return x[at];
}

}  // namespace fxdyn
