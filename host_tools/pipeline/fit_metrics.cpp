#include "host_tools/pipeline/fit_metrics.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "host_tools/identify/fit_figures.hpp"

namespace fxdyn {
namespace {

FitResult::Recursion recursion_of(const Fitter::Recursion& recursion, double forgetting) {
  FitResult::Recursion out{forgetting, {recursion.t.begin(), recursion.t.end()}, {}};
  for (const auto& row : recursion.trace.rowwise()) out.estimates.emplace_back(row.begin(), row.end());
  return out;
}

}  // namespace

MetricsResult fit_metrics(const Project& project, const Fitter& fitter, const FitFigures& estimate,
                          const std::vector<std::string>& notes, const std::vector<StageErrors>& stages) {
  FitResult fit;
  fit.method = project.identify.method;
  fit.condition_number = estimate.condition;
  for (const WeakParameter& one : estimate.weak)
    fit.weak.push_back({one.name, one.error, project.robot.joints[static_cast<std::size_t>(one.joint)].name});
  const std::vector<Eigen::Index> saturated = fitter.saturated_rows();
  fit.saturated_rows.assign(saturated.begin(), saturated.end());
  if (estimate.physical) fit.physical = physical_result(project.robot, to_dh(project.robot), *estimate.physical);
  if (estimate.recursion) fit.recursion = recursion_of(*estimate.recursion, project.identify.forgetting);
  MetricsResult out{stages.back().logs};
  out.gate = fitter.gate();
  out.base_parameters = fitter.base().columns.size();
  out.notes = notes;
  out.stages = stages;
  out.fit = std::move(fit);
  return out;
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
