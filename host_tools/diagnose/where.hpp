#pragma once

#include <vector>

#include "host_tools/diagnose/options.hpp"
#include "host_tools/effects/forward.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/report/diagnosis_result.hpp"

namespace fxdyn::diagnosis {

/// Where a gap sits: the intervals of velocity, position, acceleration, load and the direction that hold more of its
/// power than of the samples, and more than the same error shifted in time against the motion ever does
/// (ReportOptions::region_chance). Else an interval of time, or of frequency. The clearest first.
/// @param error filtered residual of the joint over each log, full rate @param noise its noise floor
GapPlace where(const IdentifiedModel& model, const std::vector<const ProcessedLog*>& logs, std::size_t joint,
               const std::vector<Eigen::VectorXd>& error, double noise, const ReportOptions& options);

}  // namespace fxdyn::diagnosis
