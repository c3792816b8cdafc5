#pragma once

#include <functional>

#include "host_tools/support/random.hpp"
#include "tests/campaign/plan.hpp"

namespace fxdyn::campaign {

/// An effect with random shape, and what to turn to make it larger.
struct Drawn {
  std::string effect;
  std::optional<std::size_t> joint;  ///< none: acts on the body
  /// The effect at size 0 .. (small to large); its torque change grows with the size.
  std::function<EffectFit(double size)> at;
  double typical = 1, largest = 1;  ///< sizes: to start the search at, and within the parameters' bounds
};

/// Shapes are drawn within what real machines have, wider than typical_shapes(). Nothing where this joint can't have
/// the effect (a lift that goes round).
std::optional<Drawn> draw(const std::string& effect, std::size_t joint, const Plan& plan, Random& random);

/// The size of an effect that gives the wanted RMS torque change (share of rated torque, joint that feels it most, over
/// the plan's motions), by regula falsi on the logarithms. Nothing where it can't be reached.
std::optional<EffectFit> scaled(const Drawn& drawn, double share, const Plan& plan);
/// Likewise for the RMS deflection of the joint, its mean apart [rad | m].
std::optional<EffectFit> scaled_to_deflection(const Drawn& drawn, double deflection, const Plan& plan);

}  // namespace fxdyn::campaign
