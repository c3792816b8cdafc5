#include "host_tools/diagnose/left_curves.hpp"

#include <algorithm>
#include <utility>

#include "host_tools/diagnose/free_curves.hpp"
#include "host_tools/diagnose/time_curve.hpp"
#include "host_tools/effects/braking.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {
namespace {

using AllCurves = std::vector<std::vector<CurveResult>>;

/// By joint.
AllCurves over_time(const Models& models, const std::vector<SessionLog>& logs, const std::vector<bool>& still) {
  AllCurves out(still.size());
  const Linearised problem(models, logs, std::vector<Eigen::VectorXd>(still.size(), Eigen::VectorXd::Zero(1)));
  const TimeCurves curves(problem);
  parallel_for(still.size(), [&](std::size_t j) {
    if (!still[j]) out[j] = curves.at(j);
  });
  return out;
}

/// Adds the curves of the motion to the models. @returns them
/// @param suspects also at joints that are only suspected of structure
Curves of_motion(Models& models, const Outcome& outcome, const Gate& gate, const std::vector<bool>& still,
                 const std::vector<SessionLog>& logs, bool suspects) {
  Curves out(still.size());
  std::vector<bool> without = still;
  for (std::size_t j = 0; j < still.size(); ++j) {
    const bool nameless = std::none_of(outcome.found.begin(), outcome.found.end(),
                                       [&](const Finding& f) { return !f.id.body && f.id.joint == j; });
    const bool suspect = suspects && nameless && outcome.lack[j].state_p < models.options.lack_of_fit.curve;
    without[j] = without[j] || !(suspect || outcome.structured(j) || gate.remains[j]);
  }
  for (const FreeCurve& curve : add_free_curves(models, logs, without))
    out[curve.effect.joint] = drawn(models, curve, logs);
  return out;
}

}  // namespace

bool is_any(const Curves& curves) {
  return std::any_of(curves.begin(), curves.end(), [](const auto& curve) { return curve.has_value(); });
}

EffectFit& effect_of(IdentifiedModel& model, const EffectId& id) {
  return id.body ? body_of(model)[id.effect] : joints_of(model)[id.joint].effects[id.effect];
}

void mark_named(IdentifiedModel& model, const Outcome& outcome) {
  for (const Finding& finding : outcome.found)
    effect_of(model, finding.id).named = finding.evidence.certainty == Certainty::established;
  for (JointFit& joint : joints_of(model)) let_it_brake(joint);  // around less than it was fitted beside
}

Models with_findings(const Outcome& outcome) {
  Models models = outcome.models;
  for (const Finding& finding : outcome.found) {
    effect_of(models.current, finding.id).named = true;
  }
  return models;
}

Curves curves_of_the_rest(const Outcome& outcome, const Gate& gate, const std::vector<bool>& still,
                          const Curves& wandering, const std::vector<SessionLog>& logs) {
  Models models = with_findings(outcome);
  Curves out = of_motion(models, outcome, gate, still, logs, true);
  for (std::size_t j = 0; j < still.size(); ++j) {
    if (wandering[j]) out[j] = wandering[j];
  }
  return out;
}

Curves take_off_what_wanders(const Outcome& outcome, const Gate& gate, const std::vector<bool>& still,
                             std::vector<SessionLog>& logs) {
  Curves out(still.size());
  Models models = with_findings(outcome);
  AllCurves all = over_time(models, logs, still);
  if (std::all_of(all.begin(), all.end(), [](const auto& of_joint) { return of_joint.empty(); })) return out;
  const Curves known = of_motion(models, outcome, gate, still, logs, false);
  for (std::size_t j = 0; j < still.size(); ++j) {
    if (known[j] || all[j].empty()) continue;
    for (const CurveResult& curve : all[j]) take_off(curve, j, joints_of(models.current)[j].sign_width, logs);
    out[j] = std::move(all[j].front());
  }
  return out;
}

bool may_enter(const CurveResult& curve, const std::vector<SessionLog>& logs, const GateOptions& options) {
  const bool sure = !curve.odds_rival || *curve.odds_rival >= options.established;
  const bool validated = std::any_of(logs.begin(), logs.end(), [](const SessionLog& log) { return !log.fits; });
  return curve.of_motion() && (sure || validated);
}

}  // namespace fxdyn::diagnosis
