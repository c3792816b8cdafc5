#pragma once

#include <algorithm>

namespace fxdyn {

/// Weight of a joint's rows in weighted least squares [1 / (N*m)^2 | 1 / N^2]: one over the mean square of what the
/// last fit left, as a Gauss-Markov estimate takes for the variance of a joint's noise.
/// @param error sum of the squares that are left over `count` rows @param signal the same of the torque. What is
/// left counts as at least 1e-9 of the signal (RMS), so that noise-free data have weights that are finite and of one
/// size.
inline double joint_weight(double count, double error, double signal) {
  return count / std::max(error, 1e-18 * signal + 1e-300);
}

}  // namespace fxdyn
