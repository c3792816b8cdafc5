#pragma once

#include <algorithm>
#include <cmath>

namespace fxdyn {

/// One shape parameter of separable least squares, from the best value so far: a step down and a step up by a ratio,
/// `rounds` times, the ratio's root taken in between. Each round steps from the value that was best before it.
/// @param attempt solves the coefficients with a value; whether that is the best so far
template <class Attempt>
void search_beside(double& best, double ratio, int rounds, double least, double most, Attempt&& attempt) {
  for (int round = 0; round < rounds; ++round, ratio = std::sqrt(ratio)) {
    const double centre = best;
    for (const double value : {std::max(least, centre / ratio), std::min(most, centre * ratio)}) {
      if (attempt(value)) best = value;
    }
  }
}

}  // namespace fxdyn
