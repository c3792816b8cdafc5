#include "host_tools/pipeline/fit_metrics.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/identify/fit_figures.hpp"
#include "host_tools/train/kept_effects.hpp"

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

void add_friction_errors(std::vector<GateErrors>& errors, Fitter fitter, const std::vector<StageErrors>& stages,
                         const std::filesystem::path& nominal) {
  if (fitter.has_validation()) {
    const auto stage =
        std::find_if(stages.begin(), stages.end(), [](const StageErrors& one) { return one.stage == "friction"; });
    for (std::size_t j = 0; j < errors.size() && stage != stages.end(); ++j)
      errors[j].friction = pooled_error(stage->logs, Role::validate, j).rmse;
    return;
  }
  if (!std::filesystem::exists(nominal)) return;
  const IdentifiedModel model = read_model(nominal);
  const KeptEffects kept(model, fitter.logs());
  fitter.set_designs(kept.design());
  fitter.set_torque_lead(model.filter.torque_lead_s, kept.torque(model, fitter.logs()));
  const std::vector<Judgement> held_out = fitter.held_out();
  for (std::size_t j = 0; j < errors.size(); ++j) errors[j].friction = held_out[j].rmse;
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
