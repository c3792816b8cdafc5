#include "host_tools/diagnose/gate.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/diagnose/refit.hpp"
#include "host_tools/model/effects.hpp"
#include "host_tools/model/evaluator.hpp"
#include "host_tools/parallel.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// What an effect must bring on data that did not fit it: squares in units of the noise.
constexpr double least_gain = 4;
/// .. and of the gap at its joint; more where the joint has structure left, whose squares are no noise.
constexpr double least_share = 0.01, least_share_in_structure = 0.02;
/// Times the plain error before.
constexpr double worse = 1.02;

HeldOut hold_out(const Linearised& at, const std::vector<MatrixXd>& features, const std::vector<std::size_t>& groups) {
  const auto n = static_cast<Index>(at.joints());
  const VectorXd& w = at.weights();
  const std::vector<Index> with = columns_of(at, groups);
  HeldOut out;
  out.before = out.after = out.leftover = out.rows = VectorXd::Zero(n);
  out.alone.assign(groups.size(), VectorXd::Zero(n));
  out.fitted_before = at.square(at.solve(at.nuisance()), at.fit_blocks()).cwiseProduct(w);
  out.fitted_after = at.square(at.solve(with), at.fit_blocks()).cwiseProduct(w);
  out.fitted_rows = at.row_count(at.fit_blocks());
  for (const Fold& fold : at.folds()) {
    out.rows += at.row_count(fold.judge);
    const LinearFit all = at.solve(with, fold.fit);
    const VectorXd after = at.square(all, fold.judge).cwiseProduct(w);
    out.after += after;
    VectorXd share(n);
    parallel_for(at.joints(), [&](std::size_t j) {
      share[static_cast<Index>(j)] = structured_share(at, j, all, features[j], fold.judge);
    });
    out.leftover += after.cwiseProduct(share);
    out.before += at.square(at.solve(at.nuisance(), fold.fit), fold.judge).cwiseProduct(w);
    for (std::size_t i = 0; i < groups.size(); ++i) {
      std::vector<std::size_t> others = groups;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      out.alone[i] += at.square(at.solve(columns_of(at, others), fold.fit), fold.judge).cwiseProduct(w) - after;
    }
  }
  return out;
}

/// Where structure remains, what counts is the error in the whole band: whitening would weigh it by how fast it is.
HeldOut judge(const Outcome& outcome, const std::vector<SessionLog>& logs, const std::vector<std::size_t>& groups) {
  HeldOut held = hold_out(*outcome.at, outcome.features, groups);
  if (!outcome.structured()) return held;
  const std::size_t n = outcome.lack.size();
  const Linearised at(outcome.models, logs, std::vector<VectorXd>(n, VectorXd::Zero(1)));
  std::vector<MatrixXd> in_band(n);
  parallel_for(n, [&](std::size_t j) { in_band[j] = features(at, j); });
  const HeldOut band = hold_out(at, in_band, groups);
  for (std::size_t j = 0; j < n; ++j) {
    if (!outcome.lack[j].structured()) continue;
    const auto k = static_cast<Index>(j);
    for (VectorXd HeldOut::*of : {&HeldOut::before, &HeldOut::after, &HeldOut::leftover, &HeldOut::rows,
                                  &HeldOut::fitted_before, &HeldOut::fitted_after, &HeldOut::fitted_rows})
      (held.*of)[k] = (band.*of)[k];
    for (std::size_t i = 0; i < groups.size(); ++i) held.alone[i][k] = band.alone[i][k];
  }
  return held;
}

VectorXd gap_of(const HeldOut& held) { return (held.before - held.after).cwiseMax(0.0) + held.leftover; }

/// Whether an effect brings anything: over all joints, and as a share of the gap at its own.
bool holds(const Outcome& outcome, const Group& group, const HeldOut& held, std::size_t i) {
  const double brings = held.alone[i].sum();
  if (brings <= least_gain) return false;
  if (group.on_body) return true;
  const std::size_t j = group.candidate.joint;
  const double share = outcome.lack[j].structured() ? least_share_in_structure : least_share;
  return brings > share * gap_of(held)[static_cast<Index>(j)];
}

/// Mean squares of the filtered error on the logs that judge; empty: there are none.
VectorXd plain_error(const IdentifiedModel& model, const std::vector<SessionLog>& logs) {
  std::vector<VectorXd> squares(logs.size());
  parallel_for(logs.size(), [&](std::size_t l) {
    if (logs[l].fits) return;
    const ProcessedLog& log = logs[l].log;
    const MatrixXd error = log.filter_columns(log.tau - predict(model, log));
    squares[l] = error.middleRows(log.first, log.last - log.first).colwise().squaredNorm().transpose();
  });
  VectorXd sum;
  for (const VectorXd& square : squares) {
    if (square.size() > 0) sum = sum.size() > 0 ? VectorXd(sum + square) : square;
  }
  return sum;
}

/// How fast drift comes to its end shows on the data that follow.
void choose_time_constants(Outcome& outcome, const std::vector<SessionLog>& logs) {
  bool drifted = false;
  for (std::size_t j = 0; j < outcome.models.current.joints.size(); ++j) {
    for (EffectFit& fit : outcome.models.current.joints[j].effects) {
      if (fit.effect != FrictionDrift::name || !fit.named) continue;
      const double found = fit.shape[0];
      double best = found, least = 1e300;
      for (const double factor : {1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125, 2.0}) {
        fit.shape[0] = std::clamp(found * factor, 0.1, 1e4);
        const Linearised at(outcome.models, logs, outcome.whitening);
        double sum = 0;
        for (const Fold& fold : at.folds())
          sum += at.square(at.solve(columns_of(at, in_model(at)), fold.fit), fold.judge)[static_cast<Index>(j)];
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

}  // namespace

std::size_t Gate::place(const Linearised& at, const EffectId& id) const {
  for (std::size_t i = 0; i < groups.size(); ++i) {
    if (at.groups()[groups[i]].id == id) return i;
  }
  return groups.size();
}

Gate pass(Outcome& outcome, const IdentifiedModel& nominal, const std::vector<SessionLog>& logs,
          const std::vector<bool>& still) {
  choose_time_constants(outcome, logs);
  const VectorXd before = plain_error(nominal, logs);
  Gate gate;
  for (;;) {
    gate.groups = in_model(*outcome.at);
    gate.held = judge(outcome, logs, gate.groups);
    const VectorXd after =
        gate.groups.empty() || before.size() == 0 ? before : plain_error(outcome.models.current, logs);
    const auto rises = [&](Index j) { return before.size() > 0 && after[j] > worse * worse * before[j]; };
    std::size_t worst = gate.groups.size();
    bool worst_on_body = false;
    for (std::size_t i = 0; i < gate.groups.size(); ++i) {
      const Group& group = outcome.at->groups()[gate.groups[i]];
      bool spoils = !group.on_body && rises(static_cast<Index>(group.candidate.joint));
      for (Index j = 0; group.on_body && j < after.size(); ++j)
        spoils |= gate.held.alone[i][j] > least_felt && rises(j);
      if (!spoils && holds(outcome, group, gate.held, i)) continue;
      // An effect on the robot that spoils joints goes before theirs, which may have been bent by it.
      const bool on_body = spoils && group.on_body;
      const bool first = worst == gate.groups.size() || (on_body && !worst_on_body);
      if (!first && (worst_on_body != on_body || gate.held.alone[i].sum() >= gate.held.alone[worst].sum())) continue;
      worst = i;
      worst_on_body = on_body;
    }
    if (worst == gate.groups.size()) break;
    const EffectId gone = outcome.at->groups()[gate.groups[worst]].id;
    std::erase_if(outcome.found, [&](const Finding& f) { return f.id == gone; });
    std::vector<EffectId> ids;
    for (const Finding& f : outcome.found) ids.push_back(f.id);
    take_back(outcome.models, ids, gone);
    for (std::size_t i = 0; i < ids.size(); ++i) outcome.found[i].id = ids[i];
    refit(outcome.models, logs, outcome.whitening, 3);
    outcome.look_again(logs);
  }

  const HeldOut& held = gate.held;
  const auto n = static_cast<Index>(outcome.lack.size());
  gate.gap = gap_of(held);
  gate.closure.setZero(n);
  for (Index j = 0; j < n; ++j) {
    const auto k = static_cast<std::size_t>(j);
    if (gate.gap[j] > 0) gate.closure[j] = (held.before[j] - held.after[j]) / gate.gap[j];
    gate.remains.push_back(!still[k] && outcome.lack[k].structured() &&
                           held.leftover[j] > (1 - sure_closure) * gate.gap[j]);
    gate.accepted.push_back(gate.closure[j] >= (gate.remains.back() ? sure_closure : least_closure));
  }
  // An effect on the robot: what comes back without it against what it leaves on the joints that it reaches.
  gate.robot_closure.assign(gate.groups.size(), 0.0);
  for (std::size_t i = 0; i < gate.groups.size(); ++i) {
    if (!outcome.at->groups()[gate.groups[i]].on_body) continue;
    double left = 0;
    for (Index j = 0; j < n; ++j) {
      if (held.alone[i][j] > least_felt) left += held.leftover[j];
    }
    const double back = held.alone[i].sum();
    gate.robot_closure[i] = back / std::max(back + left, 1e-300);
  }
  return gate;
}

}  // namespace fxdyn::diagnosis
