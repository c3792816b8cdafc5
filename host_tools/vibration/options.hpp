#pragma once

#include <vector>

namespace fxdyn {

/// Thresholds of the vibration's judgement. A line each: unit; meaning; where the value comes from, as in
/// host_tools/diagnose/options.hpp.
struct VibrationOptions {
  /// Hz; of the PD, tried; hand: robots' drives have 5 .. 50
  std::vector<double> bandwidths_hz{4, 8, 16, 24, 32, 48, 64, 96};
  /// -; of the PD, tried; hand: less than 0.3 is a loop that rings by itself (about 30 degrees of phase margin)
  std::vector<double> dampings{0.3, 0.5, 0.7, 1, 1.4};
  /// share of the residual of the PD alone; a link within it is still; hand
  double still = 0.25;
};

}  // namespace fxdyn
