#pragma once

#include <vector>

#include "host_tools/diagnose/options.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/report/diagnosis_result.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn::diagnosis {

/// Where a gap sits: the intervals of velocity, position, acceleration, load and the direction that hold more of its
/// power than of the samples, and more than the same error shifted in time against the motion ever does
/// (ReportOptions::region_chance). Else an interval of time, or of frequency. The clearest first.
/// @param joint the one at `index` @param load the rigid body's torque on it over each log, full rate [N*m | N]
/// @param error its filtered residual likewise @param noise its noise floor
GapPlace where(const Joint& joint, std::size_t index, const std::vector<const ProcessedLog*>& logs,
               const std::vector<Eigen::VectorXd>& load, const std::vector<Eigen::VectorXd>& error, double noise,
               const ReportOptions& options);

}  // namespace fxdyn::diagnosis
