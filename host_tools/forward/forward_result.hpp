#pragma once

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/robot/robot.hpp"

namespace fxdyn {

struct Forward;
struct Log;

/// Content of forward.json: a log's torque played through a model, see simulate_forward().
struct ForwardResult {
  struct Joint {
    std::string name, unit;
    double range = 0;                              ///< of the measured position [rad | m]
    std::optional<double> open_rmse, closed_rmse;  ///< of the position [rad | m]; none: that loop failed
  };
  std::string log;
  Eigen::Index given = 0;  ///< samples
  double simulated_s = 0;
  std::vector<Joint> joints;
  std::string why_open_failed, why_closed_failed;  ///< empty: it did not
};
ForwardResult forward_result(const Forward& forward, const Robot& robot, const Log& log, Eigen::Index given);
nlohmann::json to_json(const ForwardResult& result);
ForwardResult forward_of(const nlohmann::json& file);

/// For the terminal.
std::string forward_table(const ForwardResult& result);

}  // namespace fxdyn
