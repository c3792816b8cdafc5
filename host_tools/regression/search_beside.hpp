#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "host_tools/support/parallel.hpp"

namespace fxdyn {

/// One shape parameter of separable least squares, from the best value so far: a step down and a step up by a ratio,
/// `rounds` times, the ratio's root taken in between. Each round steps from the value that was best before it, so both
/// steps are made side by side.
/// @param make what a value comes to: solves the coefficients with it. Called by several threads; has a default
/// @param accept takes what make() returned, down before up; whether that is the best so far
template <class Make, class Accept>
void search_beside(double& best, double ratio, int rounds, double least, double most, Make&& make, Accept&& accept) {
  for (int round = 0; round < rounds; ++round, ratio = std::sqrt(ratio)) {
    const std::array<double, 2> values{std::max(least, best / ratio), std::min(most, best * ratio)};
    std::array<decltype(make(best)), 2> made{};
    parallel_for(values.size(), [&](std::size_t i) { made[i] = make(values[i]); });
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (accept(std::move(made[i]))) best = values[i];
    }
  }
}

}  // namespace fxdyn
