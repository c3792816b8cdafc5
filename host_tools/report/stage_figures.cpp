#include "host_tools/report/stage_figures.hpp"

#include <algorithm>
#include <cmath>

namespace fxdyn {
namespace {

/// times the least error; a stage that is so near is as good; as what a name may raise a joint's error by
/// (GateOptions::worse)
constexpr double as_good = 1.02;

/// Error of a stage on what judges; none: not known.
std::optional<double> judged_error(const GateErrors& errors, const std::string& stage) {
  if (stage == "friction") return errors.friction;
  const double error = stage == "diagnosed" ? errors.diagnosed : stage == "bls" ? errors.bls : NAN;
  return std::isfinite(error) ? std::optional(error) : std::nullopt;
}

}  // namespace

StageFigures stage_figures(const MetricsResult& result, Role role, std::size_t joint) {
  StageFigures out;
  const std::vector<StageErrors>& stages = result.stages;
  const GateErrors* judged = joint < result.gate_errors.size() ? &result.gate_errors[joint] : nullptr;
  out.exported = stages.empty() ? 0 : stages.size() - 1;
  for (std::size_t s = 0; s < stages.size(); ++s) {
    const std::string& name = stages[s].stage;
    out.shown.push_back(pooled_error(stages[s].logs, role, joint));
    out.judged.push_back(judged != nullptr ? judged_error(*judged, name) : std::nullopt);
    if (judged != nullptr && judged->exported == name) out.exported = s;
  }
  return out;
}

bool StageFigures::another_is_better_on_shown() const {
  return std::any_of(shown.begin(), shown.end(),
                     [&](const PooledError& other) { return shown[exported].rmse > as_good * other.rmse; });
}

bool StageFigures::another_is_better_on_judging() const {
  if (judged.empty() || !judged[exported]) return false;
  return std::any_of(judged.begin(), judged.end(),
                     [&](const std::optional<double>& other) { return other && *judged[exported] > as_good * *other; });
}

}  // namespace fxdyn
