#include "host_tools/diagnose/error_of_law.hpp"

#include <algorithm>

#include "host_tools/diagnose/explore.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Mean square of a joint's dry friction, as the nominal model has it, over today's logs [(N*m)^2 | N^2].
double dry_friction_power(const Outcome& outcome, std::size_t joint) {
  const EffectFit* friction = dry_friction_of(joints_of(outcome.models.current)[joint]);
  if (friction == nullptr) return 0;
  const double width = joints_of(outcome.models.current)[joint].sign_width;
  double sum = 0, samples = 0;
  for (std::size_t l = 0; l < outcome.problem->logs().size(); ++l) {
    if (outcome.problem->logs()[l].healthy) continue;
    const VectorXd dq = outcome.problem->motion(l).dq.col(static_cast<Index>(joint));
    sum += (dq / width).array().tanh().square().sum();
    samples += static_cast<double>(dq.size());
  }
  return friction->linear[0] * friction->linear[0] * sum / std::max(samples, 1.0);
}

}  // namespace

bool is_error_of_law(const Outcome& outcome, const HeldOut& held, double gap, std::size_t joint) {
  const LackOfFit& lack = outcome.lack[joint];
  const LackOfFitOptions& options = outcome.models.options.lack_of_fit;
  if (lack.elsewhere_p < options.suspected || lack.time_p < options.time) return false;
  const GateOptions& gate = outcome.models.options.gate;
  const auto k = static_cast<Index>(joint);
  const auto has = [&](auto&& of) {
    return std::any_of(outcome.found.begin(), outcome.found.end(), [&](const Finding& finding) {
      return !finding.id.body && finding.id.joint == joint &&
             of(*find_effect(joints_of(outcome.models.current)[joint].effects[finding.id.effect].effect));
    });
  };
  if (has([](const EffectInfo& info) { return info.unites_others(); })) return held.excess[k] <= gate.law_error * gap;
  if (held.plain_before.size() == 0 || !(held.before[k] > 0)) return false;
  const double excess = held.excess[k] * held.plain_before[k] / held.before[k] / std::max(held.rows[k], 1.0);
  return excess <= gate.sign_error * dry_friction_power(outcome, joint);
}

}  // namespace fxdyn::diagnosis
