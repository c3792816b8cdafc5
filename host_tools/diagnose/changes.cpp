#include "host_tools/diagnose/changes.hpp"

#include <fmt/format.h>

#include <cmath>
#include <set>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"

namespace fxdyn::diagnosis {
namespace {

/// By so many times what sessions differ by.
bool is_changed(const Unknown& u, double beyond) {
  return u.change && u.kind == Unknown::Kind::linear && std::fabs(u.value) >= beyond * u.prior_std;
}

}  // namespace

std::vector<EffectCandidate> changed_effects(const Linearised& problem) {
  std::vector<EffectCandidate> out;
  for (const Unknown& u : problem.unknowns()) {
    if (!is_changed(u, problem.options().gate.sure_deviations)) continue;
    const EffectFit& fit = problem.log_columns().joint(u.joint).effects[u.effect];
    // Of these, one that comes on top is the change: torques that add up.
    const EffectInfo& info = *find_effect(fit.effect);
    const bool memory_or_curve = info.friction && !info.nominal && !info.shape.empty() && !info.drifts();
    if (info.changes_by_one_more || memory_or_curve) out.push_back({fit.effect, u.joint, fit.shape});
  }
  return out;
}

std::vector<std::string> changed_parameters(const Linearised& problem) {
  std::vector<std::string> out;
  std::set<std::size_t> joints;
  for (const Unknown& u : problem.unknowns()) {
    if (!is_changed(u, problem.options().gate.sure_deviations)) continue;
    joints.insert(u.joint);
    const EffectFit& now = problem.log_columns().joint(u.joint).effects[u.effect];
    const Joint& joint = problem.log_columns().joint_of_robot(u.joint);
    const ParameterInfo& p = find_effect(now.effect)->linear[u.index];
    const double today = now.linear[u.index];
    const std::string_view unit = joint.type == JointType::revolute ? p.unit : p.unit_prismatic;
    out.push_back(fmt::format(
        "{}: {} ({}) is {:.4g}{}, {:.4g} in the baseline: more than {} differs from session to session, and part of "
        "the nominal model",
        joint.name, now.effect, p.name, today, unit == "-" ? "" : " " + std::string(unit), today - u.value,
        find_effect(now.effect)->friction ? "friction" : "a healthy robot"));
  }
  const auto& body = body_of(problem.log_columns().current());
  const bool load = std::any_of(body.begin(), body.end(), [](const EffectFit& fit) { return fit.named; });
  if (load && 2 * joints.size() >= problem.joints()) {
    out.push_back(
        fmt::format("friction at {} of {} joints and the load or tilt changed at once: is the baseline of this robot?",
                    joints.size(), problem.joints()));
  }
  return out;
}

}  // namespace fxdyn::diagnosis
