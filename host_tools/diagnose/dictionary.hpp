#pragma once

#include <vector>

#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

/// How a joint moves over the logs that fit.
MotionScales scales_of(const Linearised& problem, std::size_t joint);

/// Free curves of one variable with knots over each of so many parts of its range in the motion, and over those
/// between.
/// @param info a curve @param of the variable's joint, with its scales
std::vector<EffectCandidate> curves_over_parts(const EffectInfo& info, std::size_t joint, std::size_t of,
                                               const MotionScales& scales, int parts);
/// Down to eighths, each twice as fine as the one before.
inline constexpr int finest_parts = 8;

/// Candidates of the whole catalogue with their grids of shapes, for every joint and for the robot; but for what
/// `skip` names. Ripples are not among them, see ripples() in ripples.hpp.
std::vector<Group> dictionary(const Linearised& problem, const std::vector<EffectCandidate>& skip);

/// Index of the shape parameter that is searched continuously; none: -1.
int searched_shape(const EffectCandidate& candidate);

}  // namespace fxdyn::diagnosis
