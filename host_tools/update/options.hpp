#pragma once

namespace fxdyn {

/// Thresholds of the update. A line each: unit; meaning; where the value comes from, as in
/// host_tools/diagnose/options.hpp.
struct UpdateOptions {
  /// share of the new log, in time; what refits, the rest judges; hand
  double refit_share = 2.0 / 3;
  /// s; a shorter log shows too little of the motion to say anything of it; hand
  double shortest_s = 6;
};

}  // namespace fxdyn
