#pragma once

#include "host_tools/logs/log.hpp"

namespace fxdyn {

/// Median step of the stamps [s]; sets `resampled` where they are not uniform to 1 % of it.
/// @throws InputError: a gap of more than ten steps
double check_stamps(Log& log, const std::string& file);

/// All signals by linear interpolation on a grid of `step` from the first stamp on.
void resample(Log& log, double step);

/// Takes out jumps by about one turn between two samples [rad].
void unwrap(Eigen::Ref<Eigen::VectorXd> angle);

}  // namespace fxdyn
