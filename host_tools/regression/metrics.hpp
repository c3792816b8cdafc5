#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
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

/// The same of every joint of a log, as metrics.json has it.
struct LogErrors {
  std::string file;
  Role role = Role::train;
  double from_s = 0, to_s = 0;  ///< the window
  struct Joint {
    std::string name, torque_unit;
    JointMetrics metrics;
  };
  std::vector<Joint> joints;
};
LogErrors errors_of(const ProcessedLog& log, const Robot& robot, const Eigen::MatrixXd& torque);
nlohmann::json to_json(const LogErrors& errors);

/// Of one stage of the model (rigid, friction, diagnosed, bls, update) on all logs.
struct StageErrors {
  std::string stage;
  std::vector<LogErrors> logs;
};
nlohmann::json to_json(const StageErrors& stage);
nlohmann::json to_json(const std::vector<LogErrors>& logs);
std::vector<LogErrors> log_errors_of(const nlohmann::json& logs);
/// The stages in the order of metrics.json.
nlohmann::json to_json(const std::vector<StageErrors>& stages);
std::vector<StageErrors> stages_of(const nlohmann::json& metrics);

/// RMSE and RMS of the torque of one joint over all logs of a role [N*m | N], and the mean noise floor.
struct PooledError {
  double rmse = 0, rms = 0, noise_floor = 0;
  double relative() const { return rms > 0 ? rmse / rms : 0; }
};
PooledError pooled_error(const std::vector<LogErrors>& logs, Role role, std::size_t joint);

/// Mean logarithm of the errors on the validate logs; NaN where there are none.
double validation_error(const StageErrors& stage);

}  // namespace fxdyn
