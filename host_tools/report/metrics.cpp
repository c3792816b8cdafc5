#include "host_tools/report/metrics.hpp"

#include <nlohmann/json.hpp>

namespace fxdyn {

std::vector<JointMetrics> judge(const ProcessedLog& log, const Eigen::MatrixXd& torque) {
  const auto inside = [&](const Eigen::MatrixXd& m) {
    return Eigen::MatrixXd(m.middleRows(log.first, log.last - log.first));
  };
  const Eigen::MatrixXd measured = inside(log.tau), raw = inside(log.tau_raw);
  const Eigen::MatrixXd predicted = inside(log.filter_columns(torque)), predicted_raw = inside(torque);
  const Eigen::VectorXd floor = noise_floor(log);
  const double root = std::sqrt(static_cast<double>(measured.rows()));
  std::vector<JointMetrics> out;
  for (Eigen::Index j = 0; j < measured.cols(); ++j) {
    const Eigen::VectorXd error = measured.col(j) - predicted.col(j);
    JointMetrics m;
    m.rmse = error.norm() / root;
    m.relative = error.norm() / std::max(measured.col(j).norm(), 1e-300);
    m.rmse_raw = (raw.col(j) - predicted_raw.col(j)).norm() / root;
    m.noise_floor = floor[j];
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
