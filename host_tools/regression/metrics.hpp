#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "host_tools/regression/dataset.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn {

struct JointMetrics {
  double rmse = 0, relative = 0, rmse_raw = 0, noise_floor = 0, bias = 0;  ///< [N*m | N], relative [-]
};

/// Errors of the model's torque over a log with torque: both filtered alike at the torque cut-off, edges dropped;
/// rmse_raw against the unfiltered measurement. `torque` is the unfiltered model torque (predict()).
std::vector<JointMetrics> judge(const ProcessedLog& log, const Eigen::MatrixXd& torque);

nlohmann::json metrics_json(const ProcessedLog& log, const Robot& robot, const std::vector<JointMetrics>& metrics);

}  // namespace fxdyn
