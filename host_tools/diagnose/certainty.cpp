#include "host_tools/diagnose/certainty.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/diagnose/deviations.hpp"
#include "host_tools/diagnose/harmless.hpp"
#include "host_tools/diagnose/parked_columns.hpp"
#include "host_tools/diagnose/refit.hpp"
#include "host_tools/effects/model_parts.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// chi^2 of an effect on the data that judge. What else is missing at its joint may not speak for it, so its gain is
/// beside free curves of all other variables; where names close the joint's gap, nothing else is missing.
double gain_of(const Gate& gate, const Group& group, std::size_t i) {
  const double alone = gate.held.alone[i].sum();
  if (group.on_body) return alone;
  return gate.accepted[group.candidate.joint] ? std::max(alone, gate.own[i].gain) : gate.own[i].gain;
}

const EffectFit& fit_of(const IdentifiedModel& model, const EffectId& id) {
  return id.body ? body_of(model)[id.effect] : joints_of(model)[id.joint].effects[id.effect];
}

std::vector<std::size_t> felt_at(const Gate& gate, std::size_t i, double least) {
  std::vector<std::size_t> out;
  for (Index j = 0; j < gate.held.alone[i].size(); ++j) {
    if (gate.held.alone[i][j] > least) out.push_back(static_cast<std::size_t>(j));
  }
  return out;
}

}  // namespace

double new_since_baseline(Linearised& problem, const std::vector<std::size_t>& groups, std::size_t i) {
  Group both = problem.groups()[groups[i]];
  both.in_model = false;
  std::vector<std::size_t> with = groups;
  with[i] = problem.add(both, problem.make(both, true));
  const LinearFit today = problem.solver().solve(problem.columns_of(groups)),
                  always = problem.solver().solve(problem.columns_of(with));
  double out = 0;
  for (Index j = 0; j < today.square.size(); ++j) {
    if (today.square[j] > 0) out += today.rows[j] * (always.square[j] / today.square[j] - 1);
  }
  return out;
}

void judge(Evidence& evidence, bool holds, double form, const GateOptions& options) {
  const double rival = evidence.against_rival.value_or(options.established);
  evidence.there = evidence.against_nothing >= options.established;
  evidence.undecided = evidence.there && holds && rival < options.established;
  const bool sure = evidence.there && holds && evidence.deviations >= options.established_deviations;
  const bool likely =
      form >= options.least_closure && evidence.against_nothing >= options.likely && rival >= options.likely;
  evidence.certainty = sure && !evidence.undecided ? Certainty::established
                       : likely                    ? Certainty::likely
                                                   : Certainty::unlisted;
}

void weigh_evidence(Outcome& outcome, const Gate& gate) {
  const GateOptions& options = outcome.models.options.gate;
  const std::vector<double> off_nothing = deviations_off_nothing(*outcome.problem, gate.groups);
  for (Finding& finding : outcome.found) {
    const std::size_t i = gate.place(*outcome.problem, finding.id);
    if (i == gate.groups.size()) continue;
    const Group group = outcome.problem->groups()[gate.groups[i]];  // a copy: groups are added
    Evidence& evidence = finding.evidence;
    evidence.against_nothing = gain_of(gate, group, i) / variances_per_decade;
    if (outcome.models.has_baseline && !group.on_body) {
      // Data that can't say whether it is new are no reason to leave out what is there.
      const double changed = new_since_baseline(*outcome.problem, gate.groups, i) / variances_per_decade;
      if (changed < 0) evidence.against_nothing = std::min(evidence.against_nothing, changed);
    }
    if (finding.rival) evidence.against_rival = finding.rival->gain / variances_per_decade;
    evidence.deviations = off_nothing[i];
    const auto j = static_cast<Index>(group.candidate.joint);
    evidence.gain = gate.held.alone[i][j];
    const double share = gate.gap[j] > 0 ? evidence.gain / gate.gap[j] : 0;
    evidence.closure = group.on_body ? gate.robot_closure[i] : share;
    const double form = group.on_body                   ? std::max(gate.robot_closure[i], gate.robot_form[i])
                        : gate.own[i].is_stack(options) ? 0.0  // something else is there
                                                        : gate.own[i].form;
    judge(evidence, gate.believed[i], form, options);
  }
}

namespace {

/// What is left of a joint's gap, in noise variances, where it is no noise: structure, or what a curve closes.
double left_at(const Outcome& outcome, const Gate& gate, std::size_t joint, const std::optional<CurveResult>& curve) {
  const auto j = static_cast<Index>(joint);
  const double excess = outcome.structured(joint) && !gate.of_law[joint] ? gate.held.excess[j] : 0;
  if (!curve) return excess;
  const double closes = std::clamp(curve->closes, 0.0, 0.99);
  if (curve->of_motion()) return std::max(excess, closes * gate.held.after[j]);
  return excess + closes / (1 - closes) * gate.held.after[j];  // taken off the logs that judged
}

}  // namespace

void doubt_beside_more(Outcome& outcome, const Gate& gate, const Curves& curves, std::vector<Likely>& likely) {
  const double least = outcome.models.options.gate.least_closure;
  const auto closed = [&](Index j) { return std::max(gate.held.before[j] - gate.held.after[j], 0.0); };
  const auto all_at = [&](std::size_t joint) {
    return closed(static_cast<Index>(joint)) + left_at(outcome, gate, joint, curves[joint]);
  };
  // A part that is not the larger one is what a larger effect of another form leaves, sooner than an effect.
  const auto smaller_part = [&](const Finding& finding) {
    const double gap = gate.gap[static_cast<Index>(finding.id.joint)];
    return finding.evidence.gain < least * std::max({finding.evidence.gain, gap, all_at(finding.id.joint)});
  };
  for (Finding& finding : outcome.found) {
    Certainty& certainty = finding.evidence.certainty;
    if (finding.id.body) continue;
    const std::size_t joint = finding.id.joint;
    if (certainty == Certainty::likely && smaller_part(finding)) certainty = Certainty::unlisted;
    const bool more_left = closed(static_cast<Index>(joint)) < least * all_at(joint);
    if (certainty == Certainty::established && more_left) certainty = Certainty::likely;
  }
  std::erase_if(likely, [&](const Likely& one) { return !one.finding.id.body && smaller_part(one.finding); });
}

namespace {

/// Whether the second of two outcomes errs less on what judges, in the geometric mean of the joints, by more than one
/// further pass of the search brings by itself: it is the likelier one, with variances unknown.
bool errs_less_in_all(const VectorXd& before, const VectorXd& after) {
  constexpr double worth_it = 0.99;  // of the squares
  double sum = 0;
  for (Index j = 0; j < before.size(); ++j) {
    if (before[j] > 0 && after[j] > 0) sum += std::log(after[j] / before[j]);
  }
  return sum < static_cast<double>(before.size()) * std::log(worth_it);
}

/// .. and at no joint by more than a name may raise the error.
bool errs_less(const VectorXd& before, const VectorXd& after, const GateOptions& options) {
  for (Index j = 0; j < before.size(); ++j) {
    if (is_worse(options, before, after, j)) return false;
  }
  return errs_less_in_all(before, after);
}

using Tried = std::vector<EffectCandidate>;

EffectCandidate candidate_of(const Outcome& outcome, const Finding& finding) {
  const EffectFit& fit = fit_of(outcome.models.current, finding.id);
  return {fit.effect, finding.id.joint, fit.shape};
}

/// Whether two are one effect, whose shape a fit may have moved a little.
bool is_same(const EffectCandidate& a, const EffectCandidate& b) {
  constexpr double moved = 0.1;
  return a.effect == b.effect && a.joint == b.joint &&
         std::equal(a.shape.begin(), a.shape.end(), b.shape.begin(), b.shape.end(),
                    [](double x, double y) { return std::fabs(x - y) <= moved * std::fabs(x); });
}

/// The finding that is there for sure under a name that is not, since its rival is near; the nearest, but for those
/// that were tried. Null: there is none.
const Finding* without_a_sure_name(const Outcome& outcome, const Tried& tried) {
  const double established = outcome.models.options.gate.established;
  const Finding* out = nullptr;
  for (const Finding& finding : outcome.found) {
    const Evidence& evidence = finding.evidence;
    if (!evidence.there || !finding.rival || evidence.against_rival.value_or(established) >= established) continue;
    const EffectCandidate candidate = candidate_of(outcome, finding);
    const bool known = std::any_of(tried.begin(), tried.end(),
                                   [&](const EffectCandidate& other) { return is_same(other, candidate); });
    if (!known && (out == nullptr || finding.rival->gain < out->rival->gain)) out = &finding;
  }
  return out;
}

}  // namespace

std::optional<Outcome> with_free_background(const Outcome& outcome, const std::vector<SessionLog>& logs) {
  Outcome out;
  out.models = outcome.models;
  const auto grew = [&](const EffectCandidate& held) {
    return std::any_of(outcome.found.begin(), outcome.found.end(), [&](const Finding& finding) {
      return !finding.id.body && finding.id.joint == held.joint && candidate_of(outcome, finding).effect == held.effect;
    });
  };
  std::vector<EffectCandidate>& held = out.models.held;
  if (std::erase_if(held, [&](const EffectCandidate& one) { return !grew(one); }) == 0) return {};
  out.found = outcome.found;
  out.dropped = outcome.dropped;
  out.whitening = outcome.whitening;
  out.not_identifiable = outcome.not_identifiable;
  refit(out.models, logs, out.whitening, 8);
  out.look_again(logs);
  return out;
}

bool take_if_better(Outcome& outcome, Gate& gate, Outcome other, const Retrial& retrial) {
  Gate of_other = pass(other, retrial.nominal, retrial.logs, retrial.still);
  const VectorXd before = judged_error(outcome.models, retrial.logs);
  const VectorXd after = judged_error(other.models, retrial.logs);
  if (!errs_less(before, after, outcome.models.options.gate)) return false;
  outcome = std::move(other);
  gate = std::move(of_other);
  return true;
}

std::vector<EffectCandidate> named_in(const Outcome& outcome) {
  std::vector<EffectCandidate> out;
  for (const Finding& finding : outcome.found) out.push_back(candidate_of(outcome, finding));
  return out;
}

void search_again(const std::vector<EffectCandidate>& before, Outcome& outcome, Gate& gate, const Retrial& retrial,
                  Progress& progress) {
  const std::vector<EffectCandidate> passed = named_in(outcome);
  SearchTask task = retrial.task;
  for (const EffectCandidate& one : before) {
    const bool stays = std::any_of(passed.begin(), passed.end(), [&](const EffectCandidate& other) {
      return other.effect == one.effect && other.joint == one.joint;
    });
    if (!stays && find_effect(one.effect)->unites_others()) task.never.push_back(one);
  }
  if (passed.size() == before.size() && !outcome.dropped) return;
  ParkedColumns parked(outcome.features);
  Outcome other = explore_again(outcome, retrial.logs, task, progress);
  Gate of_other = pass(other, retrial.nominal, retrial.logs, retrial.still);
  // The gate sees to it that no joint errs more than in the nominal model.
  if (!errs_less_in_all(judged_error(outcome.models, retrial.logs), judged_error(other.models, retrial.logs))) {
    parked.take_back();
    return;
  }
  outcome = std::move(other);
  gate = std::move(of_other);
}

bool settle_rivals(Outcome& outcome, Gate& gate, const Retrial& retrial, Progress& progress) {
  constexpr std::size_t most = 4;  // a pass of the search each
  Tried tried;
  bool settled = false;
  while (tried.size() < most) {
    const Finding* finding = without_a_sure_name(outcome, tried);
    if (finding == nullptr) break;
    tried.push_back(candidate_of(outcome, *finding));
    ParkedColumns parked(outcome.features);
    Outcome other = explore_rival(outcome, *finding, retrial.logs, retrial.task, progress);
    Gate of_other = pass(other, retrial.nominal, retrial.logs, retrial.still);
    const VectorXd before = judged_error(outcome.models, retrial.logs);
    const VectorXd after = judged_error(other.models, retrial.logs);
    if (!errs_less(before, after, outcome.models.options.gate)) {
      parked.take_back();
      continue;
    }
    weigh_evidence(other, of_other);
    outcome = std::move(other);
    gate = std::move(of_other);
    settled = true;
  }
  return settled;
}

namespace {

bool is_not_there(const Finding& finding) { return !finding.evidence.there; }

/// Takes out what is not there, fits what is left again and judges it. @param likely what of it is likely
void take_out_what_is_not_there(Outcome& outcome, Gate& gate, const IdentifiedModel& nominal,
                                const std::vector<SessionLog>& logs, const std::vector<bool>& still,
                                std::vector<Likely>& likely) {
  Models with = outcome.models;
  add_deviations(with, *outcome.problem);
  std::vector<EffectId> gone;
  for (const Finding& finding : outcome.found) {
    if (!is_not_there(finding)) continue;
    gone.push_back(finding.id);
    if (finding.evidence.certainty == Certainty::unlisted) continue;
    const std::size_t i = gate.place(*outcome.problem, finding.id);
    const double felt = outcome.models.options.gate.least_gain;
    likely.push_back({finding, fit_of(with.current, finding.id), felt_at(gate, i, felt)});
  }
  while (!gone.empty()) {
    const EffectId one = gone.back();
    gone.pop_back();
    std::erase_if(outcome.found, [&](const Finding& f) { return f.id == one; });
    std::vector<EffectId> ids = gone;
    for (const Finding& f : outcome.found) ids.push_back(f.id);
    take_back(outcome.models, ids, one);
    std::copy_n(ids.begin(), gone.size(), gone.begin());
    for (std::size_t i = 0; i < outcome.found.size(); ++i) outcome.found[i].id = ids[gone.size() + i];
  }
  refit(outcome.models, logs, outcome.whitening, 4);
  outcome.look_again(logs);
  fit_without_harm(outcome, nominal, logs);
  gate = judge_again(outcome, logs, still);
}

}  // namespace

void set_aside(Outcome& outcome, Gate& gate, const IdentifiedModel& nominal, const std::vector<SessionLog>& logs,
               const std::vector<bool>& still, std::vector<Likely>& likely) {
  weigh_evidence(outcome, gate);
  // What goes may have carried others, whose evidence was weighed beside it.
  while (std::any_of(outcome.found.begin(), outcome.found.end(), is_not_there)) {
    take_out_what_is_not_there(outcome, gate, nominal, logs, still, likely);
    weigh_evidence(outcome, gate);
  }
}

}  // namespace fxdyn::diagnosis
