#pragma once

#include <vector>

#include "host_tools/diagnose/diagnosis_result.hpp"
#include "host_tools/diagnose/options.hpp"
#include "host_tools/effects/forward.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn::diagnosis {

/// Where a gap sits: the regions of velocity, position, acceleration, load, direction, time and frequency that hold
/// clearly more of its power than of the samples, the most telling first.
/// @param error filtered residual of the joint over each log, full rate @param noise its noise floor
std::vector<GapRegion> where(const IdentifiedModel& model, const std::vector<const ProcessedLog*>& logs,
                             std::size_t joint, const std::vector<Eigen::VectorXd>& error, double noise,
                             const ReportOptions& options);

}  // namespace fxdyn::diagnosis
