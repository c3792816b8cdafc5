#include "host_tools/diagnose/refit.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "host_tools/diagnose/models.hpp"
#include "host_tools/effects/braking.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/regression/gauss_newton.hpp"
#include "host_tools/regression/solver.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Of the unknowns, in the models that the problem is about.
VectorXd values_of(const Linearised& problem) {
  VectorXd out(static_cast<Index>(problem.unknowns().size()));
  for (Index c = 0; c < out.size(); ++c) out[c] = problem.unknowns()[static_cast<std::size_t>(c)].value;
  return out;
}

/// -2 ln likelihood of the models as they are, but for a constant: by joint, and of what was known beforehand.
struct Misfit {
  VectorXd of_joint;
  double of_priors = 0;
  double sum() const { return of_joint.sum() + of_priors; }
};

Misfit misfit(const Linearised& problem) {
  LinearFit now;
  now.columns = problem.unknown_columns();
  now.x = values_of(problem);
  Misfit out;
  for (const Unknown& u : problem.unknowns()) {
    if (u.prior_std > 0) out.of_priors += std::pow((u.value - u.prior) / u.prior_std, 2);
  }
  const VectorXd square = problem.solver().square(now, problem.blocks().fit);
  const VectorXd rows = problem.solver().row_count(problem.blocks().fit);
  out.of_joint.resize(square.size());
  for (Index j = 0; j < square.size(); ++j) {
    out.of_joint[j] =
        rows[j] * std::log(std::max(square[j], 1e-300)) - 2 * problem.noise().log_scale(static_cast<std::size_t>(j));
  }
  return out;
}

/// Gauss-Newton over all unknowns. Where a step does no good, the joints whose error it raised have widths and shapes
/// held: their friction may be of a form that none suits, and what else there is to fit, at all joints, is linear.
class Refit {
 public:
  Refit(std::vector<SessionLog> logs, std::vector<VectorXd> whitening, std::vector<bool> only, std::size_t joints)
      : logs_(std::move(logs)), whitening_(std::move(whitening)), only_(std::move(only)), held_(joints, false) {}

  Models run(Models models, int rounds) {
    if (judge(models) == Trial::rejected) return models;  // no figures at all
    const GaussNewton rules{.most_rounds = rounds, .shrink = 0.3};
    do {
      risen_.assign(held_.size(), false);
      models = gauss_newton(
          models, rules, [&](const Models&, int) { return steps_ < rounds ? std::optional(step()) : std::nullopt; },
          [&](const Models& from, const LinearFit& fit, double share) {
            Models there = from;
            update(there, around_->unknowns(), fit, share);
            return there;
          },
          [&](const Models&, const Models& there, int) { return judge(there); });
    } while (hold_risen());
    return models;
  }

 private:
  static constexpr double counts = 1;  ///< one variance of one parameter

  Trial judge(const Models& there) {
    auto problem = std::make_unique<Linearised>(there, logs_, whitening_);
    whitening_ = problem->noise().whitening();  // one for all rounds, else their misfits can't be compared
    const Misfit now = misfit(*problem);
    if (around_ && !(now.sum() < least_.sum())) {
      for (std::size_t j = 0; j < held_.size(); ++j) {
        const auto k = static_cast<Index>(j);
        if (!(now.of_joint[k] < least_.of_joint[k] + counts)) risen_[j] = true;
      }
      return Trial::rejected;
    }
    if (!std::isfinite(now.sum())) return Trial::rejected;
    const bool converged = around_ && least_.sum() - now.sum() < counts;
    if (around_) ++steps_;
    least_ = now;
    around_ = std::move(problem);
    risen_.assign(held_.size(), false);
    return converged ? Trial::converged : Trial::accepted;
  }
  /// Coefficients of the free columns, around those of the others as they are.
  LinearFit step() const {
    const BlockSolver& solver = around_->solver();
    MatrixXd gram;
    VectorXd projection;
    solver.normal(around_->unknown_columns(), solver.blocks().fit, gram, projection);
    LinearFit fit;
    const std::vector<Index> all = free();
    fit.columns = all;
    VectorXd x = values_of(*around_);
    // What would leave its range ends there, and the others are fitted beside that.
    for (std::vector<Index> beyond;;) {
      for (const Index c : fit.columns) x[c] = 0;
      const VectorXd rest = projection - gram * x;
      x(fit.columns) = SymmetricSolver(gram(fit.columns, fit.columns)).solve(VectorXd(rest(fit.columns)));
      beyond.clear();
      for (const Index c : fit.columns) {
        const double most = around_->unknowns()[static_cast<std::size_t>(c)].most();
        if (x[c] <= most) continue;
        x[c] = most;
        beyond.push_back(c);
      }
      if (beyond.empty()) break;
      std::erase_if(fit.columns, [&](Index c) { return std::find(beyond.begin(), beyond.end(), c) != beyond.end(); });
    }
    fit.columns = all;
    fit.x = x(all);
    return fit;
  }
  /// Columns of the unknowns that are not held.
  std::vector<Index> free() const {
    std::vector<Index> out;
    for (const Index c : around_->unknown_columns()) {
      const Unknown& u = around_->unknowns()[static_cast<std::size_t>(c)];
      const bool of_joint = u.kind != Unknown::Kind::base && !u.body;
      if (!only_.empty() && !(of_joint && only_[u.joint])) continue;
      if (!(u.is_logarithm() && of_joint && held_[u.joint])) out.push_back(c);
    }
    return out;
  }
  /// @returns whether a width or shape is held that was not, since the last step was rejected
  bool hold_risen() {
    const std::size_t before = free().size();
    for (std::size_t j = 0; j < held_.size(); ++j) held_[j] = held_[j] || risen_[j];
    return free().size() < before;
  }

  std::vector<SessionLog> logs_;
  std::vector<VectorXd> whitening_;
  std::vector<bool> only_;
  std::vector<bool> held_;   ///< by joint: its widths and shapes stay
  std::vector<bool> risen_;  ///< by joint: a step that was rejected since the last good one raised its misfit
  std::unique_ptr<Linearised> around_;  ///< the best so far
  Misfit least_;
  int steps_ = 0;
};

}  // namespace

void refit(Models& models, const std::vector<SessionLog>& all, const std::vector<VectorXd>& given, int rounds,
           const std::vector<bool>& only) {
  std::vector<SessionLog> logs;
  for (const SessionLog& log : all) {
    if (log.fits) logs.push_back(log);
  }
  models = Refit(std::move(logs), given, only, joints_of(models.current).size()).run(models, rounds);
}

void bring_rotor(Models& models, const Rotor& rotor, double inertia) {
  EffectFit fit;
  fit.effect = rotor_effect().name;
  fit.linear = {inertia};
  std::vector<ModelValue*> of{&models.current};
  if (models.has_baseline) of.push_back(&models.healthy);
  for (ModelValue* model : of) {
    joints_of(*model)[rotor.joint].effects.push_back(fit);
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
  auto& effects = group.on_body ? body_of(models.current) : joints_of(models.current)[joint].effects;
  effects.push_back(std::move(fit));
  const EffectId id{group.on_body, joint, effects.size() - 1};
  const JointFit& of = joints_of(models.current)[joint];
  if (group.rotor && rotor_of(of) == nullptr) {
    bring_rotor(models, *group.rotor, group.rotor_inertia);
  }
  return id;
}

namespace {

void remove(Models& models, std::vector<EffectId>& ids, const EffectId& id) {
  auto& effects = id.body ? body_of(models.current) : joints_of(models.current)[id.joint].effects;
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
  let_it_brake(joints_of(models.current)[id.joint]);
  const auto& left = joints_of(models.current)[id.joint].effects;
  if (std::none_of(left.begin(), left.end(), [](const EffectFit& fit) { return separates_rotor(fit.effect); }))
    forget_rotor(models, ids, id.joint);
}

bool forget_rotor(Models& models, std::vector<EffectId>& ids, std::size_t joint) {
  const auto it =
      std::find_if(models.rotors.begin(), models.rotors.end(), [&](const Rotor& r) { return r.joint == joint; });
  if (it == models.rotors.end()) return false;
  const auto is_rotor = [](const EffectFit& fit) { return in_base(fit.effect); };
  const auto& effects = joints_of(models.current)[joint].effects;
  const auto fit = std::find_if(effects.begin(), effects.end(), is_rotor);
  // The base parameters have it back.
  for (ModelValue* model : {&models.current, &models.healthy}) take_from_base(*model, it->in_base, -fit->linear[0]);
  remove(models, ids, {false, joint, static_cast<std::size_t>(fit - effects.begin())});
  if (models.has_baseline) std::erase_if(joints_of(models.healthy)[joint].effects, is_rotor);
  models.rotors.erase(it);
  return true;
}

}  // namespace fxdyn::diagnosis
