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

/// Share of the squared residual on the rows that fit which is a function of the state.
double fitted_share(const Outcome& outcome, std::size_t joint) {
  const Linearised& problem = *outcome.problem;
  const LinearFit fit = problem.solver().solve(problem.columns_of(in_model(problem)));
  return structured_share(problem, joint, fit, outcome.features[joint], problem.blocks().fit_of(false));
}

}  // namespace

bool is_error_of_law(const Outcome& outcome, const HeldOut& held, double gap, std::size_t joint) {
  const LackOfFit& lack = outcome.lack[joint];
  const LackOfFitOptions& options = outcome.models.options.lack_of_fit;
  if (lack.elsewhere_p < options.suspected || lack.time_p < options.time) return false;
  const GateOptions& gate = outcome.models.options.gate;
  const auto k = static_cast<Index>(joint);
  const bool has_law = std::any_of(outcome.found.begin(), outcome.found.end(), [&](const Finding& finding) {
    return !finding.id.body && finding.id.joint == joint &&
           find_effect(joints_of(outcome.models.current)[joint].effects[finding.id.effect].effect)->unites_others();
  });
  if (has_law) return held.excess[k] <= gate.law_error * gap;
  // Beside a baseline what its friction leaves is known; more is a change.
  if (outcome.models.has_baseline || held.plain_before.size() == 0 || !(held.before[k] > 0)) return false;
  const double allowed = gate.sign_error * dry_friction_power(outcome, joint);
  const double squared_torque = held.plain_before[k] / held.before[k];
  const auto is_small = [&](double squares, double rows) {
    const double power = squares * squared_torque / std::max(rows, 1.0);
    return power > 0 && power <= allowed;
  };
  return is_small(held.excess[k], held.rows[k]) &&
         is_small(held.fitted_after[k] * fitted_share(outcome, joint), held.fitted_rows[k]);
}

}  // namespace fxdyn::diagnosis
