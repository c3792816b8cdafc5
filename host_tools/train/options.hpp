#pragma once

namespace fxdyn {

/// Thresholds of the training. A line each: unit; meaning; where the value comes from, as in
/// host_tools/diagnose/options.hpp.
struct TrainOptions {
  /// share of the held-out error; what a BLS must take away; hand
  double worth_keeping = 0.05;
  /// times the error of what was fitted; beyond, the structure alone does not carry over to the logs that judge, and
  /// nor does what is learned beside it; hand
  double carries_over = 3;
  /// times the least held-out error; candidates below are as good, and the quietest of them is taken; hand
  double nearly_as_good = 1.05;
};

/// Of what stays as diagnosis found it.
struct KeptOptions {
  /// share of a saturation's limit; a torque beyond may hide a larger one; hand: noise and the filter's overshoot
  double at_limit = 0.98;
};

}  // namespace fxdyn
