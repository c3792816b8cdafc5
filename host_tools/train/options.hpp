#pragma once

namespace fxdyn {

/// Thresholds of the training. A line each: unit; meaning; where the value comes from, as in
/// host_tools/diagnose/options.hpp.
struct TrainOptions {
  /// share of the held-out error; what a BLS must take away; hand
  double worth_keeping = 0.05;
  /// times the error of what was fitted; where train logs judge one another and the structure alone does worse, none of
  /// them tells enough of the others to judge what is learned beside it; hand
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
