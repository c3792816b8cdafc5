#include "host_tools/diagnose/harmless.hpp"

#include <optional>
#include <utility>

#include "host_tools/diagnose/base_parameters.hpp"
#include "host_tools/diagnose/plain_error.hpp"
#include "host_tools/diagnose/refit.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::VectorXd;

std::vector<VectorXd> whole_band(const Models& models) {
  return std::vector<VectorXd>(joints_of(models.current).size(), VectorXd::Zero(1));
}

/// By joint: whether something was found there.
std::vector<bool> found_at(const Outcome& outcome) {
  std::vector<bool> out(joints_of(outcome.models.current).size(), false);
  for (const Finding& finding : outcome.found) out[finding.id.joint] = true;
  return out;
}

/// What `to` has in common with `from` gets its values. @returns false: they have not the same effects, but for those
/// at the end of `to`
bool take_values(JointFit& to, const JointFit& from) {
  if (from.effects.size() > to.effects.size()) return false;
  for (std::size_t e = 0; e < from.effects.size(); ++e) {
    if (from.effects[e].effect != to.effects[e].effect) return false;
    to.effects[e] = from.effects[e];
  }
  to.sign_width = from.sign_width;
  return true;
}

/// The models with all that they have in common with the nominal one as it is there. None: there is something on the
/// robot, or a rotor that the base parameters are without.
std::optional<Models> around(Models models, const IdentifiedModel& nominal) {
  IdentifiedModel& current = models.current;
  if (!body_of(current).empty() || base_of(current).size() != base_of(nominal).size()) return {};
  for (std::size_t j = 0; j < joints_of(current).size(); ++j) {
    const bool has = rotor_of(joints_of(nominal)[j]) != nullptr;
    if (has != (rotor_of(joints_of(current)[j]) != nullptr) ||
        !take_values(joints_of(current)[j], joints_of(nominal)[j]))
      return {};
  }
  for (std::size_t c = 0; c < base_of(current).size(); ++c) {
    const double step = base_of(nominal)[c].value - base_of(current)[c].value;
    add_to_base(current, c, step);
    if (models.has_baseline) add_to_base(models.healthy, c, step);
  }
  return models;
}

}  // namespace

bool fit_without_harm(Outcome& outcome, const IdentifiedModel& nominal, const std::vector<SessionLog>& logs) {
  const GateOptions& options = outcome.models.options.gate;
  const std::size_t harmed = count_harmed(options, nominal, outcome.models.current, logs);
  if (harmed == 0) return false;
  const auto better = [&](Models models) {
    if (count_harmed(options, nominal, models.current, logs) >= harmed) return false;
    outcome.models = std::move(models);
    outcome.look_again(logs);
    return true;
  };
  Models in_band = outcome.models;
  refit(in_band, logs, whole_band(in_band), 4);
  if (better(std::move(in_band))) return true;
  std::optional<Models> at_joints = around(outcome.models, nominal);
  if (!at_joints) return false;
  refit(*at_joints, logs, whole_band(*at_joints), 4, found_at(outcome));
  return better(std::move(*at_joints));
}

}  // namespace fxdyn::diagnosis
