#pragma once

namespace fxdyn {

/// Thresholds of the forward simulation. A line each: unit; meaning; where the value comes from, as in
/// host_tools/diagnose/options.hpp.
struct ForwardOptions {
  /// share of the joint's range; a torque that does not change while its joint covers it is stuck; hand: a current
  /// sensor's step is seen as often as the friction is even, over a few per cent of the range
  double stuck_share = 0.3;
};

}  // namespace fxdyn
