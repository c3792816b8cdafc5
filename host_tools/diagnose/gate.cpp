#include "host_tools/diagnose/gate.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include "host_tools/diagnose/deviations.hpp"
#include "host_tools/diagnose/error_of_law.hpp"
#include "host_tools/diagnose/explore.hpp"
#include "host_tools/diagnose/harmless.hpp"
#include "host_tools/diagnose/refit.hpp"
#include "host_tools/diagnose/vanished.hpp"
#include "host_tools/diagnose/without.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Rows of one stretch, in seconds: neighbouring errors say the same.
constexpr double stretch_s = 2;
/// Standard deviations to either side of a normal distribution's 95 %.
constexpr double deviations_of_95 = 1.96;

/// Adds a fold's stretches at a joint. @param before, after residuals of all rows
void add_stretches(const Linearised& problem, const Fold& fold, const VectorXd& before, const VectorXd& after,
                   double weight, std::vector<Stretch>& to) {
  for (const std::size_t b : fold.judge) {
    const Block& block = problem.blocks().all[b];
    if (block.healthy) continue;
    const ProcessedLog& log = problem.logs()[block.log].log;
    const auto rows = std::max<Index>(1, whole(stretch_s / (log.step_s * static_cast<double>(log.decimation))));
    for (Index first = 0; first < block.count; first += rows) {
      const Index from = block.first + first, count = std::min(rows, block.count - first);
      to.push_back({weight * before.segment(from, count).squaredNorm(),
                    weight * after.segment(from, count).squaredNorm(), static_cast<double>(count)});
    }
  }
}

/// Squares of judged rows, coefficients of some groups fitted to others.
VectorXd judged(const Linearised& problem, const std::vector<std::size_t>& groups, const Fold& fold) {
  const BlockSolver& solver = problem.solver();
  return solver.square(solver.solve(problem.columns_of(groups), fold.fit), fold.judge);
}

/// .. of a model with all that it has.
VectorXd judged(const Linearised& problem, const Fold& fold) { return judged(problem, in_model(problem), fold); }

HeldOut hold_out(const Linearised& problem, const std::vector<MatrixXd>& features,
                 const std::vector<std::size_t>& groups) {
  const auto n = static_cast<Index>(problem.joints());
  const VectorXd& w = problem.solver().weights();
  const std::vector<Index> with = problem.columns_of(groups);
  HeldOut out;
  out.before = out.after = out.leftover = out.excess = out.rows = VectorXd::Zero(n);
  out.alone.assign(groups.size(), VectorXd::Zero(n));
  out.stretches.resize(problem.joints());
  const std::unique_ptr<Linearised> plain = groups.empty() ? nullptr : without(problem, groups);
  const Linearised& before = plain ? *plain : problem;
  const Fold fitted{problem.blocks().fit, problem.blocks().fit_of(false)};
  out.fitted_before = judged(before, fitted).cwiseProduct(w);
  out.fitted_after = judged(problem, groups, fitted).cwiseProduct(w);
  out.fitted_rows = problem.solver().row_count(fitted.judge);
  for (const Fold& fold : problem.blocks().folds) {
    out.rows += problem.solver().row_count(fold.judge);
    const LinearFit all = problem.solver().solve(with, fold.fit);
    const VectorXd after = problem.solver().square(all, fold.judge).cwiseProduct(w);
    out.after += after;
    const LinearFit none = before.solver().solve(before.columns_of(in_model(before)), fold.fit);
    VectorXd share(n), healthy(VectorXd::Zero(n));
    parallel_for(problem.joints(), [&](std::size_t j) {
      const auto k = static_cast<Index>(j);
      share[k] = structured_share(problem, j, all, features[j], fold.judge);
      if (problem.models().has_baseline)
        healthy[k] = structured_share(problem, j, all, features[j], problem.blocks().fit, true);
      add_stretches(problem, fold, before.solver().residual(j, none), problem.solver().residual(j, all), w[k],
                    out.stretches[j]);
    });
    out.leftover += after.cwiseProduct(share);
    out.excess += after.cwiseProduct((share - healthy).cwiseMax(0.0));
    out.before += before.solver().square(none, fold.judge).cwiseProduct(w);
  }
  for (std::size_t i = 0; i < groups.size(); ++i) {
    std::vector<std::size_t> others = groups;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    std::unique_ptr<Linearised> less;
    if (works_on_others(problem.groups()[groups[i]]) && !others.empty()) less = without(problem, {groups[i]});
    for (const Fold& fold : problem.blocks().folds) {
      const VectorXd squares = others.empty() ? judged(before, fold)
                               : less         ? judged(*less, fold)
                                              : judged(problem, others, fold);
      out.alone[i] += squares.cwiseProduct(w);
    }
    out.alone[i] -= out.after;
  }
  return out;
}

/// Where structure remains, what counts is the error in the whole band: whitening would weigh it by how fast it is.
HeldOut judge(const Outcome& outcome, const std::vector<SessionLog>& logs, const std::vector<std::size_t>& groups) {
  HeldOut held = hold_out(*outcome.problem, outcome.features, groups);
  if (!outcome.structured()) return held;
  const std::size_t n = outcome.lack.size();
  const Linearised problem(outcome.models, logs, std::vector<VectorXd>(n, VectorXd::Zero(1)));
  std::vector<MatrixXd> in_band(n);
  parallel_for(n, [&](std::size_t j) { in_band[j] = features(problem, j, problem.models().has_baseline); });
  const HeldOut band = hold_out(problem, in_band, groups);
  // As torques: weights are of this outcome's own residual.
  held.plain_before = band.before.cwiseQuotient(problem.solver().weights());
  held.plain_after = band.after.cwiseQuotient(problem.solver().weights());
  for (std::size_t j = 0; j < n; ++j) {
    if (!outcome.structured(j)) continue;
    const auto k = static_cast<Index>(j);
    for (VectorXd HeldOut::*of :
         {&HeldOut::before, &HeldOut::after, &HeldOut::leftover, &HeldOut::excess, &HeldOut::rows,
          &HeldOut::fitted_before, &HeldOut::fitted_after, &HeldOut::fitted_rows})
      (held.*of)[k] = (band.*of)[k];
    held.stretches[j] = band.stretches[j];
    for (std::size_t i = 0; i < groups.size(); ++i) held.alone[i][k] = band.alone[i][k];
  }
  return held;
}

/// Squares of the error in the whole band where logs judge one another: each fold by a fit of the others, without the
/// named effects and with them.
struct PlainErrors {
  VectorXd before, after;
};
PlainErrors judged_plainly(const Outcome& outcome, const std::vector<SessionLog>& logs, const Gate& gate) {
  if (gate.held.plain_after.size() > 0) return {gate.held.plain_before, gate.held.plain_after};
  const std::vector<std::size_t>& groups = gate.groups;
  const std::size_t n = outcome.lack.size();
  const Linearised with(outcome.models, logs, std::vector<VectorXd>(n, VectorXd::Zero(1)));
  const std::unique_ptr<Linearised> plain = without(with, groups);
  PlainErrors out{VectorXd::Zero(static_cast<Index>(n)), VectorXd::Zero(static_cast<Index>(n))};
  for (const Fold& fold : with.blocks().folds) {
    out.before += judged(*plain, fold);
    out.after += judged(with, groups, fold);
  }
  return out;
}

VectorXd gap_of(const HeldOut& held) { return (held.before - held.after).cwiseMax(0.0) + held.excess; }

/// Whether an effect brings anything: over all joints, and as a share of the gap at its own.
bool holds(const Outcome& outcome, const Group& group, const HeldOut& held, std::size_t i) {
  const GateOptions& options = outcome.models.options.gate;
  const double brings = held.alone[i].sum();
  if (brings <= options.least_gain) return false;
  // At its bound a load is what would weigh less than nothing.
  if (is_load(group.candidate.effect) && body_of(outcome.models.current)[group.id.effect].linear[0] <= least_mass)
    return false;
  if (group.on_body) return true;
  const std::size_t j = group.candidate.joint;
  const JointFit& joint = joints_of(outcome.models.current)[j];
  if (is_at_nothing(*outcome.problem, group, joint.effects[group.id.effect])) return false;
  if (held.alone[i][static_cast<Index>(j)] <= 0) return false;  // whatever it does at others
  // With nothing left over the noise is what it says it is, and a small effect beside a large one is no less sure.
  return !outcome.structured(j) || brings > options.least_share_in_structure * gap_of(held)[static_cast<Index>(j)];
}

/// How fast drift comes to its end shows on the data that follow.
void choose_time_constants(Outcome& outcome, const std::vector<SessionLog>& logs) {
  bool drifted = false;
  for (std::size_t j = 0; j < joints_of(outcome.models.current).size(); ++j) {
    for (EffectFit& fit : joints_of(outcome.models.current)[j].effects) {
      if (!drifts(fit.effect) || !fit.named) continue;
      const double found = fit.shape[0];
      double best = found, least = 1e300;
      for (const double factor : {1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125, 2.0}) {
        fit.shape[0] = std::clamp(found * factor, 0.1, 1e4);
        const Linearised problem(outcome.models, logs, outcome.whitening);
        double sum = 0;
        for (const Fold& fold : problem.comparing()) sum += judged(problem, fold)[static_cast<Index>(j)];
        if (sum >= least) continue;
        least = sum;
        best = fit.shape[0];
      }
      fit.shape[0] = best;
      drifted = true;
    }
  }
  if (!drifted) return;
  refit(outcome.models, logs, outcome.whitening, 4);
  outcome.look_again(logs);
}

/// Whether a name's form holds against a free curve of its variable.
bool form_holds(const OwnEvidence& own, const GateOptions& options) {
  const bool several = own.alike > 1;
  if (own.is_stack(options)) return false;
  if (own.curve_gain >= options.established * variances_per_decade)
    return own.form >= (several && own.of_position ? options.several_closure : options.sure_closure);
  return own.form >= (several ? options.sure_closure : options.least_closure);
}

/// By joint: what is there has another form than the names that it got.
std::vector<bool> lacking_form(const Gate& gate, const Outcome& outcome) {
  const GateOptions& options = outcome.models.options.gate;
  std::vector<bool> out(outcome.lack.size(), false);
  for (std::size_t i = 0; i < gate.groups.size(); ++i) {
    const Group& group = outcome.problem->groups()[gate.groups[i]];
    const OwnEvidence& own = gate.own[i];
    if (group.on_body || form_holds(own, options)) continue;
    out[group.candidate.joint] = out[group.candidate.joint] || own.is_stack(options) ||
                                 own.curve_gain >= options.established * variances_per_decade;
  }
  return out;
}

/// Which names are believed at each joint.
void conclude(Gate& gate, const Outcome& outcome, const std::vector<bool>& still) {
  const std::vector<bool> misnamed = lacking_form(gate, outcome);
  const GateOptions& options = outcome.models.options.gate;
  const HeldOut& held = gate.held;
  const auto n = static_cast<Index>(outcome.lack.size());
  gate.gap = gap_of(held);
  gate.closure.setZero(n);
  gate.remains.clear();
  gate.of_law.clear();
  gate.accepted.clear();
  for (Index j = 0; j < n; ++j) {
    const auto k = static_cast<std::size_t>(j);
    const double closed = held.before[j] - held.after[j];
    if (gate.gap[j] > 0) gate.closure[j] = closed / gate.gap[j];
    // Of a large gap a small share may still be plain beside the noise.
    const double noise = std::max(held.after[j] - held.leftover[j], 0.0);
    const double counts = std::min((1 - options.sure_closure) * gate.gap[j], options.beyond_noise * noise);
    const bool left = outcome.structured(k) && held.excess[j] > counts;
    gate.of_law.push_back(outcome.structured(k) && is_error_of_law(outcome, held, gate.gap[j], k));
    gate.remains.push_back(!still[k] && (misnamed[k] || (left && !gate.of_law[k])));
    // Names have to close what may be a law's error, too, to be more than that.
    const bool closely = !still[k] && (misnamed[k] || left);
    gate.accepted.push_back(gate.closure[j] >= (closely ? options.sure_closure : options.least_closure));
  }
}

/// Which effects at a joint are believed: those of a joint whose gap they close together, and those that have evidence
/// of their own. None that a free curve of its variable is better than.
void believe(Gate& gate, const Outcome& outcome) {
  const GateOptions& options = outcome.models.options.gate;
  gate.believed.assign(gate.groups.size(), false);
  for (std::size_t i = 0; i < gate.groups.size(); ++i) {
    const Group& group = outcome.problem->groups()[gate.groups[i]];
    if (group.on_body) continue;
    const OwnEvidence& own = gate.own[i];
    const bool by_itself = !own.of_time && own.gain >= options.sure_gain && own.form >= options.sure_closure;
    gate.believed[i] = form_holds(own, options) && (gate.accepted[group.candidate.joint] || by_itself);
  }
}

/// Whitening that changes nothing.
std::vector<VectorXd> whole_band(std::size_t joints) { return std::vector<VectorXd>(joints, VectorXd::Zero(1)); }

/// Of several findings the one without which fewest joints err more than before, and of such the whole least.
/// @param before squares of the plain error on what judges
std::size_t culprit(const std::vector<std::size_t>& suspects, const Gate& gate, const Outcome& outcome,
                    const VectorXd& before, const std::vector<SessionLog>& logs) {
  std::size_t out = suspects.front();
  if (suspects.size() == 1) return out;
  std::pair<Index, double> least{before.size() + 1, 0};
  for (const std::size_t i : suspects) {
    Models without = outcome.models;
    std::vector<EffectId> none;
    take_back(without, none, outcome.problem->groups()[gate.groups[i]].id);
    refit(without, logs, whole_band(outcome.lack.size()), 3);
    const VectorXd error = judged_error(without, logs);
    Index worse = 0;
    for (Index j = 0; j < error.size(); ++j) worse += is_worse(without.options.gate, before, error, j) ? 1 : 0;
    const std::pair left{worse, error.array().max(1e-300).log().sum()};
    if (!(left < least)) continue;
    least = left;
    out = i;
  }
  return out;
}

/// Takes out the names of a joint's position that close, one after the other, ever more of something else. @returns
/// whether there were any
bool take_out_stack(Outcome& outcome, const Gate& gate, const std::vector<SessionLog>& logs) {
  std::vector<EffectId> stack;
  for (std::size_t i = 0; i < gate.groups.size(); ++i) {
    const Group& group = outcome.problem->groups()[gate.groups[i]];
    if (group.on_body || !gate.own[i].is_stack(outcome.models.options.gate)) continue;
    if (stack.empty() || stack.front().joint == group.id.joint) stack.push_back(group.id);
  }
  if (stack.empty()) return false;
  for (const EffectId& id : stack) std::erase_if(outcome.found, [&](const Finding& f) { return f.id == id; });
  std::vector<EffectId> ids = stack;
  for (const Finding& f : outcome.found) ids.push_back(f.id);
  for (std::size_t left = stack.size(); left > 0; --left) {
    const EffectId gone = ids.front();
    ids.erase(ids.begin());
    take_back(outcome.models, ids, gone);
  }
  for (std::size_t i = 0; i < outcome.found.size(); ++i) outcome.found[i].id = ids[i];
  refit(outcome.models, logs, outcome.whitening, 3);
  outcome.look_again(logs);
  return true;
}

/// The named effect that goes first, as a place in the gate's groups; their number: all hold.
/// @param before, after squares of the plain error on what judges
std::size_t weakest(const Gate& gate, const Outcome& outcome, const VectorXd& before, const VectorXd& after,
                    const std::vector<SessionLog>& logs) {
  const auto rises = [&](Index j) { return is_worse(outcome.models.options.gate, before, after, j); };
  const std::size_t none = gate.groups.size();
  std::vector<std::size_t> spoilers;
  for (std::size_t i = 0; i < none; ++i) {
    const Group& group = outcome.problem->groups()[gate.groups[i]];
    bool spoils = !group.on_body && rises(static_cast<Index>(group.candidate.joint));
    // Whatever it brings there: a load that others make up for in the linear fit may be far off in the model.
    for (std::size_t j = 0; group.on_body && j < outcome.problem->joints(); ++j)
      spoils |= outcome.problem->solver().rows(j).place(group.first) >= 0 && rises(static_cast<Index>(j));
    if (spoils) spoilers.push_back(i);
  }
  // An effect on the robot may have bent those of the joints, or one of them that joint.
  if (!spoilers.empty()) return culprit(spoilers, gate, outcome, before, logs);
  const std::vector<double> off_nothing = deviations_off_nothing(*outcome.problem, gate.groups);
  std::size_t worst = none;
  for (std::size_t i = 0; i < none; ++i) {
    const bool sure = off_nothing[i] >= outcome.models.options.gate.sure_deviations;
    if (sure && holds(outcome, outcome.problem->groups()[gate.groups[i]], gate.held, i)) continue;
    if (worst == none || gate.held.alone[i].sum() < gate.held.alone[worst].sum()) worst = i;
  }
  if (worst != none) return worst;
  // What is found elsewhere may spoil a joint at which nothing is.
  for (Index j = 0; j < static_cast<Index>(outcome.problem->joints()); ++j) {
    if (!rises(j)) continue;
    double most = 0;
    for (std::size_t i = 0; i < none; ++i) {
      if (gate.held.alone[i][j] >= most) continue;
      most = gate.held.alone[i][j];
      worst = i;
    }
    if (worst != none) return worst;
  }
  // Beside a background, and with no more structure than the healthy session has, what is not believed only resembles
  // that background.
  for (std::size_t i = 0; i < none; ++i) {
    const Group& group = outcome.problem->groups()[gate.groups[i]];
    const std::size_t j = group.candidate.joint;
    if (group.on_body || outcome.problem->background(j) == nullptr || outcome.structured(j) || gate.believed[i])
      continue;
    if (worst == none || gate.held.alone[i].sum() < gate.held.alone[worst].sum()) worst = i;
  }
  return worst;
}

}  // namespace

std::size_t Gate::place(const Linearised& problem, const EffectId& id) const {
  for (std::size_t i = 0; i < groups.size(); ++i) {
    if (problem.groups()[groups[i]].id == id) return i;
  }
  return groups.size();
}

namespace {

/// An effect on the robot: what comes back without it against what it leaves on the joints that it reaches. It is
/// believed where it closes their gaps, or its form holds, whatever else is missing there.
void judge_robot(Gate& gate, const Outcome& outcome) {
  const GateOptions& options = outcome.models.options.gate;
  const HeldOut& held = gate.held;
  gate.robot_closure.assign(gate.groups.size(), 0.0);
  gate.robot_form.assign(gate.groups.size(), 0.0);
  for (std::size_t i = 0; i < gate.groups.size(); ++i) {
    if (!outcome.problem->groups()[gate.groups[i]].on_body) continue;
    double left = 0;
    for (Index j = 0; j < held.excess.size(); ++j) {
      if (held.alone[i][j] > options.least_gain) left += held.excess[j];
    }
    const double back = held.alone[i].sum();
    gate.robot_closure[i] = back / std::max(back + left, 1e-300);
    gate.robot_form[i] = form_on_robot(*outcome.problem, gate.groups, gate.groups[i]);
    gate.believed[i] = gate.robot_closure[i] >= options.least_closure ||
                       (back >= options.sure_gain && gate.robot_form[i] >= options.sure_closure);
  }
}

}  // namespace

Share left_of(const HeldOut& held, double gap, Index joint) {
  Share out;
  if (!(gap > 0)) return out;
  const std::vector<Stretch>& stretches = held.stretches[static_cast<std::size_t>(joint)];
  double rows = 0, square = 0;
  for (const Stretch& s : stretches) rows += s.rows;
  out.share = held.excess[joint] / gap;
  const double noise = (held.after[joint] - held.excess[joint]) / std::max(rows, 1.0);
  for (const Stretch& s : stretches) {
    const double left = s.after - noise * s.rows;
    square += std::pow(left - out.share * (s.before - s.after + left), 2);
  }
  const double reach = deviations_of_95 * std::sqrt(square) / gap;
  out.low = std::max(0.0, out.share - reach);
  out.high = std::min(1.0, out.share + reach);
  return out;
}

Gate judge_again(const Outcome& outcome, const std::vector<SessionLog>& logs, const std::vector<bool>& still) {
  Gate gate;
  gate.groups = in_model(*outcome.problem);
  gate.held = judge(outcome, logs, gate.groups);
  gate.own = own_evidence(*outcome.problem, gate.groups, outcome.features);
  conclude(gate, outcome, still);
  believe(gate, outcome);
  judge_robot(gate, outcome);
  return gate;
}

Gate pass(Outcome& outcome, const IdentifiedModel& nominal, const std::vector<SessionLog>& logs,
          const std::vector<bool>& still) {
  choose_time_constants(outcome, logs);
  const VectorXd validated = plain_error(nominal, logs);
  Gate gate;
  for (;;) {
    gate = judge_again(outcome, logs, still);
    // The curve can have their place in the model only where validate logs confirm it; else their torque stays.
    if (validated.size() > 0 && take_out_stack(outcome, gate, logs)) continue;
    PlainErrors errors{validated, validated};
    if (!gate.groups.empty()) {
      if (fit_without_harm(outcome, nominal, logs)) {
        gate = judge_again(outcome, logs, still);
        if (validated.size() > 0 && take_out_stack(outcome, gate, logs)) continue;
      }
      if (validated.size() > 0) {
        errors.after = plain_error(outcome.models.current, logs);
      } else {
        errors = judged_plainly(outcome, logs, gate);
      }
    }
    const std::size_t worst = weakest(gate, outcome, errors.before, errors.after, logs);
    if (worst == gate.groups.size()) break;
    take_out(outcome, outcome.problem->groups()[gate.groups[worst]].id, logs);
  }
  return gate;
}

std::optional<EffectId> harmful_finding(const Outcome& outcome, const IdentifiedModel& before,
                                        const IdentifiedModel& after, const std::vector<SessionLog>& logs) {
  const std::vector<bool> harmed = harmed_joints(outcome.models.options.gate, before, after, logs);
  for (std::size_t j = 0; j < harmed.size(); ++j) {
    if (!harmed[j]) continue;
    const auto rank = [&](const Finding& f) {
      const int distance = f.id.body ? 1 : f.id.joint == j ? 0 : 2;
      return std::pair(distance, f.score);
    };
    const auto first = std::min_element(outcome.found.begin(), outcome.found.end(),
                                        [&](const Finding& a, const Finding& b) { return rank(a) < rank(b); });
    return first == outcome.found.end() ? std::nullopt : std::optional(first->id);
  }
  return vanished_finding(outcome, after);
}

VectorXd judged_error(const Models& models, const std::vector<SessionLog>& logs) {
  VectorXd out = plain_error(models.current, logs);
  if (out.size() > 0) return out;
  const Linearised problem(models, logs, whole_band(joints_of(models.current).size()));
  out = VectorXd::Zero(static_cast<Index>(joints_of(models.current).size()));
  for (const Fold& fold : problem.comparing()) out += judged(problem, fold);
  return out;
}

void take_out(Outcome& outcome, EffectId gone, const std::vector<SessionLog>& logs) {
  std::erase_if(outcome.found, [&](const Finding& f) { return f.id == gone; });
  std::vector<EffectId> ids;
  for (const Finding& f : outcome.found) ids.push_back(f.id);
  take_back(outcome.models, ids, gone);
  for (std::size_t i = 0; i < ids.size(); ++i) outcome.found[i].id = ids[i];
  refit(outcome.models, logs, outcome.whitening, 3);
  outcome.look_again(logs);
}

}  // namespace fxdyn::diagnosis
