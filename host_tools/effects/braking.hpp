#pragma once

#include <optional>
#include <string>

#include "host_tools/effects/joint_fit.hpp"

// Friction brakes. An effect whose parameters could say otherwise declares when (EffectTraits::brakes).

namespace fxdyn {

/// Why an effect of the joint is no friction: a parameter out of its range, or one that would drive the joint instead
/// of braking it. Nothing where all are friction.
/// @param dq_limit of the joint [rad/s | m/s]; 0: not known
std::optional<std::string> why_it_does_not_brake(const JointFit& joint, double dq_limit);

/// The largest value of the coefficient with which this effect of the joint brakes; nothing where it always does.
std::optional<double> most_that_brakes(const JointFit& joint, const EffectFit& fit, double dq_limit);

/// Lowers such coefficients of the joint to just below that, at the joint's limit.
void let_it_brake(JointFit& joint);

}  // namespace fxdyn
