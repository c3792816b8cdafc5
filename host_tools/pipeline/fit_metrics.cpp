#include "host_tools/pipeline/fit_metrics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/identify/fit_figures.hpp"
namespace fxdyn {

using nlohmann::json;

namespace {

/// Estimates on the way through the logs: one row a moment, base parameters first, then each joint's coefficients.
json recursion_json(const Fitter::Recursion& recursion, double forgetting) {
  json trace = json::array();
  for (Eigen::Index k = 0; k < recursion.trace.rows(); ++k) {
    const Eigen::VectorXd row = recursion.trace.row(k);
    trace.push_back(std::vector<double>(row.begin(), row.end()));
  }
  return {{"forgetting", forgetting},
          {"t", std::vector<double>(recursion.t.begin(), recursion.t.end())},
          {"estimates", trace}};
}

}  // namespace

json fit_metrics(const Project& project, const Fitter& fitter, const FitFigures& estimate,
                 const std::vector<std::string>& notes, const std::vector<StageErrors>& stages) {
  json metrics = {{"schema", "fxdyn.metrics/1"},
                  {"gate", fitter.gate()},
                  {"base_parameters", fitter.base().columns.size()},
                  {"notes", notes},
                  {"logs", to_json(stages.back().logs)},
                  {"stages", to_json(stages)}};
  metrics["method"] = project.identify.method;
  metrics["condition_number"] = std::isfinite(estimate.condition) ? json(estimate.condition) : json(nullptr);
  metrics["weak_parameters"] = json::array();
  for (const WeakParameter& one : estimate.weak) {
    metrics["weak_parameters"].push_back(
        {{"parameter", one.name},
         {"share_of_rated", one.error},
         {"joint_to_move", project.robot.joints[static_cast<std::size_t>(one.joint)].name}});
  }
  const std::vector<Eigen::Index> saturated = fitter.saturated_rows();
  metrics["saturated_rows"] = std::vector<std::int64_t>(saturated.begin(), saturated.end());
  if (estimate.physical) {
    metrics["physical"] = physical_json(project.robot, to_dh(project.robot), *estimate.physical);
  }
  if (estimate.recursion) metrics["recursive"] = recursion_json(*estimate.recursion, project.identify.forgetting);
  return metrics;
}

std::string weak_note(const std::vector<WeakParameter>& weak, const Robot& robot) {
  if (weak.empty()) return {};
  std::string names;
  for (const WeakParameter& one : weak) names += (names.empty() ? "" : ", ") + one.name;
  const auto worst =
      std::max_element(weak.begin(), weak.end(), [](const auto& a, const auto& b) { return a.error < b.error; });
  return fmt::format(
      "these logs tell {} poorly (at the limits up to {:.0f} % of rated torque): move joint {} ({}) more and faster",
      names, 100 * worst->error, worst->joint + 1, robot.joints[static_cast<std::size_t>(worst->joint)].name);
}

}  // namespace fxdyn
