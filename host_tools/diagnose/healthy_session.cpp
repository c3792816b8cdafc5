#include "host_tools/diagnose/healthy_session.hpp"

#include <algorithm>
#include <utility>

#include "host_tools/diagnose/gate.hpp"
#include "host_tools/diagnose/refit.hpp"
#include "host_tools/effects/model_parts.hpp"

namespace fxdyn::diagnosis {
namespace {

/// Ripple is finer than the functions that the test for lack of fit knows.
bool has_ripples(const Models& models, const std::vector<SessionLog>& logs, const SearchSettings& settings,
                 Progress& progress) {
  Linearised problem(models, logs);
  return !Search(problem, {settings, {}}).run({}, progress).groups.empty();
}

double mean_logarithm(const Eigen::VectorXd& squares) { return squares.array().max(1e-300).log().mean(); }

}  // namespace

HealthySession learn_healthy(Models nominal, const std::vector<SessionLog>& logs, const SearchTask& task,
                             Progress& progress) {
  const std::size_t joints = joints_of(nominal.current).size();
  refit(nominal, logs, std::vector<Eigen::VectorXd>(joints, Eigen::VectorXd::Zero(1)), 8);
  HealthySession out{std::move(nominal), {}};
  Outcome outcome;
  outcome.models = out.models;
  outcome.look_again(logs);
  SearchTask modest = task;
  modest.settings.most = std::max<std::size_t>(2, joints * task.settings.max_effects);
  if (outcome.structured() || has_ripples(out.models, logs, modest.settings, progress)) {
    // All that has a form: what stays is taken out of today's logs without one.
    outcome.put_down();
    outcome = explore(out.models, logs, modest, 2, progress);
    out.models = outcome.models;
    for (std::size_t j = 0; j < joints; ++j) {
      for (EffectFit& fit : joints_of(out.models.current)[j].effects) {
        if (fit.named) out.effects.push_back({fit.effect, j, fit.shape});
        fit.named = false;
      }
      if (outcome.structured(j)) out.structured.push_back(j);
    }
    for (EffectFit& fit : body_of(out.models.current)) fit.named = false;
  }
  out.error = judged_error(out.models, logs);
  return out;
}

bool errs_less(const HealthySession& one, const HealthySession& other) {
  return mean_logarithm(one.error) < mean_logarithm(other.error);
}

}  // namespace fxdyn::diagnosis
