#pragma once

#include <vector>

#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

/// Wavenumbers at which a joint's residual ripples, the strongest first: peaks of
///   P(n) = |sum g exp(i n q)|^2 / expected power,
/// g the residual with the adjoint of filter, decimation and whitening applied, so that no column has to be made.
/// @param residual whitened, all rows
/// @param most so many at most
std::vector<Group> ripples(const Linearised& problem, std::size_t joint, const Eigen::VectorXd& residual,
                           std::size_t most);

}  // namespace fxdyn::diagnosis
