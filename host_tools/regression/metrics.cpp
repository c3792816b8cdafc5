#include "host_tools/regression/metrics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "host_tools/support/json_number.hpp"

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

LogErrors errors_of(const ProcessedLog& log, const Robot& robot, const Eigen::MatrixXd& torque) {
  LogErrors out{log.name, log.role, log.from_s, log.to_s, {}};
  const std::vector<JointMetrics> metrics = judge(log, torque);
  for (std::size_t j = 0; j < metrics.size(); ++j)
    out.joints.push_back({robot.joints[j].name, robot.joints[j].torque_unit(), metrics[j]});
  return out;
}

nlohmann::json to_json(const LogErrors& errors) {
  nlohmann::json joints = nlohmann::json::array();
  for (std::size_t j = 0; j < errors.joints.size(); ++j) {
    const auto& [name, unit, m] = errors.joints[j];
    joints.push_back({{"joint", name},
                      {"index", j + 1},
                      {"unit", unit},
                      {"rmse", m.rmse},
                      {"relative", m.relative},
                      {"rmse_raw", m.rmse_raw},
                      {"noise_floor", m.noise_floor},
                      {"bias", m.bias}});
  }
  return {{"file", errors.file},
          {"role", to_string(errors.role)},
          {"from_s", errors.from_s},
          {"to_s", errors.to_s},
          {"joints", joints}};
}

nlohmann::json to_json(const std::vector<LogErrors>& logs) {
  nlohmann::json out = nlohmann::json::array();
  for (const LogErrors& log : logs) out.push_back(to_json(log));
  return out;
}

nlohmann::json to_json(const StageErrors& stage) { return {{"stage", stage.stage}, {"logs", to_json(stage.logs)}}; }

nlohmann::json to_json(const std::vector<StageErrors>& stages) {
  nlohmann::json out = nlohmann::json::array();
  for (const StageErrors& stage : stages) out.push_back(to_json(stage));
  return out;
}

namespace {

LogErrors read_log_errors(const nlohmann::json& json) {
  LogErrors out{json.at("file"), role_of(json.at("role").get<std::string>()), json.at("from_s"), json.at("to_s"), {}};
  for (const nlohmann::json& joint : json.at("joints")) {
    out.joints.push_back(
        {joint.at("joint"),
         joint.at("unit"),
         {number_of(joint.at("rmse")), number_of(joint.at("relative")), number_of(joint.at("rmse_raw")),
          number_of(joint.at("noise_floor")), number_of(joint.at("bias"))}});
  }
  return out;
}

}  // namespace

std::vector<LogErrors> log_errors_of(const nlohmann::json& logs) {
  std::vector<LogErrors> out;
  for (const nlohmann::json& log : logs) out.push_back(read_log_errors(log));
  return out;
}

std::vector<StageErrors> stages_of(const nlohmann::json& metrics) {
  std::vector<StageErrors> out;
  for (const nlohmann::json& stage : metrics.at("stages"))
    out.push_back({stage.at("stage"), log_errors_of(stage.at("logs"))});
  return out;
}

PooledError pooled_error(const std::vector<LogErrors>& logs, Role role, std::size_t joint) {
  double error = 0, torque = 0, floor = 0;
  int count = 0;
  for (const LogErrors& log : logs) {
    if (log.role != role) continue;
    const JointMetrics& m = log.joints.at(joint).metrics;
    const double rms = m.relative > 0 ? m.rmse / m.relative : 0;
    error += m.rmse * m.rmse;
    torque += rms * rms;
    floor += m.noise_floor * m.noise_floor;
    ++count;
  }
  const double n = std::max(1, count);
  return {std::sqrt(error / n), std::sqrt(torque / n), std::sqrt(floor / n)};
}

double validation_error(const StageErrors& stage) {
  double sum = 0, count = 0;
  for (const LogErrors& log : stage.logs) {
    if (log.role != Role::validate) continue;
    for (const LogErrors::Joint& joint : log.joints) {
      sum += std::log(std::max(joint.metrics.rmse, 1e-300));
      ++count;
    }
  }
  return sum / count;
}

}  // namespace fxdyn
