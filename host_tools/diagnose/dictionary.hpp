#pragma once

#include <vector>

#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

/// Candidates of the whole catalogue with their grids of shapes, for every joint and for the robot; but for what
/// `skip` names. Ripples are not among them, see ripples().
std::vector<Group> dictionary(const Linearised& problem, const std::vector<EffectCandidate>& skip);

/// Wavenumbers at which a joint's residual ripples, the strongest first: peaks of
///   P(n) = |sum g exp(i n q)|^2 / expected power,
/// g the residual with the adjoint of filter, decimation and whitening applied, so that no column has to be made.
std::vector<Group> ripples(const Linearised& problem, std::size_t joint, const Eigen::VectorXd& residual,
                           std::size_t most);

/// Index of the shape parameter that is searched continuously; none: -1.
int searched_shape(const EffectCandidate& candidate);

}  // namespace fxdyn::diagnosis
