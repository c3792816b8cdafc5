#include "host_tools/diagnose/refit.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "host_tools/diagnose/models.hpp"
#include "host_tools/effects/braking.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/regression/gauss_newton.hpp"
#include "host_tools/regression/solver.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

/// -2 ln likelihood of the models as they are, but for a constant.
double misfit(const Linearised& problem) {
  LinearFit now;
  now.columns = problem.unknown_columns();
  now.x.resize(static_cast<Index>(now.columns.size()));
  double sum = 0;
  for (std::size_t c = 0; c < problem.unknowns().size(); ++c) {
    const Unknown& u = problem.unknowns()[c];
    now.x[static_cast<Index>(c)] = u.value;
    if (u.prior_std > 0) sum += std::pow((u.value - u.prior) / u.prior_std, 2);
  }
  const VectorXd square = problem.solver().square(now, problem.blocks().fit);
  const VectorXd rows = problem.solver().row_count(problem.blocks().fit);
  for (Index j = 0; j < square.size(); ++j) {
    sum += rows[j] * std::log(std::max(square[j], 1e-300));
    sum -= 2 * problem.noise().log_scale(static_cast<std::size_t>(j));
  }
  return sum;
}

}  // namespace

void refit(Models& models, const std::vector<SessionLog>& all, const std::vector<VectorXd>& given, int rounds) {
  constexpr double converged_below = 1;  // one variance of one parameter
  std::vector<VectorXd> whitening = given;
  std::vector<SessionLog> logs;
  for (const SessionLog& log : all) {
    if (log.fits) logs.push_back(log);
  }
  std::unique_ptr<Linearised> around;  // the best so far
  double least = 1e300;
  int tried = 0;
  const auto judge = [&](const Models& there) {
    auto problem = std::make_unique<Linearised>(there, logs, whitening);
    whitening = problem->noise().whitening();  // one for all rounds, else their misfits can't be compared
    const double now = misfit(*problem);
    if (!(now < least)) return Trial::rejected;
    const bool converged = least - now < converged_below;
    least = now;
    around = std::move(problem);
    return converged ? Trial::converged : Trial::accepted;
  };
  if (judge(models) == Trial::rejected) return;  // no figures at all
  const auto step = [&](const Models&, int) {
    return tried < rounds ? std::optional(around->solver().solve(around->unknown_columns())) : std::nullopt;
  };
  const auto move = [&](const Models& from, const LinearFit& fit, double share) {
    Models there = from;
    update(there, around->unknowns(), fit, share);
    return there;
  };
  const auto accept = [&](const Models&, const Models& there, int) {
    ++tried;
    return judge(there);
  };
  models = gauss_newton(models, {.most_rounds = rounds, .shrink = 0.3}, step, move, accept);
}

void bring_rotor(Models& models, const Rotor& rotor, double inertia) {
  EffectFit fit;
  fit.effect = rotor_effect().name;
  fit.linear = {inertia};
  std::vector<IdentifiedModel*> of{&models.current};
  if (models.has_baseline) of.push_back(&models.healthy);
  for (IdentifiedModel* model : of) {
    model->joints[rotor.joint].effects.push_back(fit);
    take_from_base(*model, rotor.in_base, inertia);
  }
  models.rotors.push_back(rotor);
}

EffectId name(Models& models, const Group& group, const VectorXd& theta) {
  EffectFit fit;
  fit.effect = group.candidate.effect;
  fit.shape = group.candidate.shape;
  fit.named = true;
  const EffectInfo& info = *find_effect(fit.effect);
  const bool load = is_load(fit.effect);
  for (Index i = 0; i < theta.size(); ++i) {
    const ParameterInfo& p = info.linear[static_cast<std::size_t>(i)];
    fit.linear.push_back(load ? theta[i] : std::clamp(theta[i], p.lower, p.upper));
  }
  if (info.share) fit.linear[0] = 1;
  if (load) {
    fit.linear[0] = std::max(fit.linear[0], least_mass);
    for (std::size_t i = 1; i < fit.linear.size(); ++i)
      fit.linear[i] = std::clamp(fit.linear[i] / fit.linear[0], -10.0, 10.0);
  }
  const std::size_t joint = group.candidate.joint;
  auto& effects = group.on_body ? models.current.body : models.current.joints[joint].effects;
  effects.push_back(std::move(fit));
  const EffectId id{group.on_body, joint, effects.size() - 1};
  const JointFit& of = models.current.joints[joint];
  if (group.rotor && rotor_of(of) == nullptr) {
    bring_rotor(models, *group.rotor, group.rotor_inertia);
  }
  return id;
}

namespace {

void remove(Models& models, std::vector<EffectId>& ids, const EffectId& id) {
  auto& effects = id.body ? models.current.body : models.current.joints[id.joint].effects;
  effects.erase(effects.begin() + static_cast<std::ptrdiff_t>(id.effect));
  for (EffectId& other : ids) {
    if (other.body == id.body && other.joint == id.joint && other.effect > id.effect) --other.effect;
  }
}

}  // namespace

void take_back(Models& models, std::vector<EffectId>& ids, const EffectId& id) {
  remove(models, ids, id);
  if (id.body) return;
  // Beside less friction bristles may have less damping.
  let_it_brake(models.current.joints[id.joint]);
  const auto& left = models.current.joints[id.joint].effects;
  if (std::none_of(left.begin(), left.end(), [](const EffectFit& fit) { return separates_rotor(fit.effect); }))
    forget_rotor(models, ids, id.joint);
}

bool forget_rotor(Models& models, std::vector<EffectId>& ids, std::size_t joint) {
  const auto it =
      std::find_if(models.rotors.begin(), models.rotors.end(), [&](const Rotor& r) { return r.joint == joint; });
  if (it == models.rotors.end()) return false;
  const auto is_rotor = [](const EffectFit& fit) { return in_base(fit.effect); };
  const auto& effects = models.current.joints[joint].effects;
  const auto fit = std::find_if(effects.begin(), effects.end(), is_rotor);
  // The base parameters have it back.
  for (IdentifiedModel* model : {&models.current, &models.healthy})
    take_from_base(*model, it->in_base, -fit->linear[0]);
  remove(models, ids, {false, joint, static_cast<std::size_t>(fit - effects.begin())});
  if (models.has_baseline) std::erase_if(models.healthy.joints[joint].effects, is_rotor);
  models.rotors.erase(it);
  return true;
}

}  // namespace fxdyn::diagnosis
