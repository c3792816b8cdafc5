#include "host_tools/regression/metrics.hpp"

#include <nlohmann/json.hpp>

namespace fxdyn {

std::vector<JointMetrics> judge(const ProcessedLog& log, const Eigen::MatrixXd& torque) {
  const Eigen::Index count = log.last - log.first;
  const double root = std::sqrt(static_cast<double>(count));
  std::vector<JointMetrics> out;
  for (Eigen::Index j = 0; j < log.tau.cols(); ++j) {
    const auto inside = [&](const auto& column) { return Eigen::VectorXd(column.segment(log.first, count)); };
    const Eigen::VectorXd measured = inside(log.filter_columns(log.tau.col(j)).col(0));
    const Eigen::VectorXd error = measured - inside(log.filter_columns(torque.col(j)).col(0));
    JointMetrics m;
    m.rmse = error.norm() / root;
    m.relative = error.norm() / std::max(measured.norm(), 1e-300);
    m.rmse_raw = inside(log.tau.col(j) - torque.col(j)).norm() / root;
    m.noise_floor = log.torque_noise[j];
    m.bias = error.mean();
    out.push_back(m);
  }
  return out;
}

nlohmann::json metrics_json(const ProcessedLog& log, const Robot& robot, const std::vector<JointMetrics>& metrics) {
  nlohmann::json joints = nlohmann::json::array();
  for (std::size_t j = 0; j < metrics.size(); ++j) {
    const JointMetrics& m = metrics[j];
    joints.push_back({{"joint", robot.joints[j].name},
                      {"index", j + 1},
                      {"unit", robot.joints[j].torque_unit()},
                      {"rmse", m.rmse},
                      {"relative", m.relative},
                      {"rmse_raw", m.rmse_raw},
                      {"noise_floor", m.noise_floor},
                      {"bias", m.bias}});
  }
  return {{"file", log.name},
          {"role", to_string(log.role)},
          {"from_s", log.from_s},
          {"to_s", log.to_s},
          {"joints", joints}};
}

}  // namespace fxdyn
