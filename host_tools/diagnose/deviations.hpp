#pragma once

#include <vector>

#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

/// Standard deviations of the current model's parameters from the information of a fit around the models as they are.
void add_deviations(Models& models, const Linearised& problem);

/// Standard deviations by which the coefficients of each group together are off nothing,
///   sqrt(theta^T C^-1 theta), C their covariance with the group's shapes held.
/// What the shapes leave open is which curve it is, not whether it is there. A share, which is 1 by definition, gets
/// 1e300.
std::vector<double> deviations_off_nothing(const Linearised& problem, const std::vector<std::size_t>& groups);

}  // namespace fxdyn::diagnosis
