#pragma once

#include <vector>

#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

/// How a joint moves over the logs that fit.
MotionScales scales_of(const Linearised& problem, std::size_t joint);

/// Candidates of the whole catalogue with their grids of shapes, for every joint and for the robot; but for what
/// `skip` names. Ripples are not among them, see ripples() in ripples.hpp.
std::vector<Group> dictionary(const Linearised& problem, const std::vector<EffectCandidate>& skip);

/// Index of the shape parameter that is searched continuously; none: -1.
int searched_shape(const EffectCandidate& candidate);

}  // namespace fxdyn::diagnosis
