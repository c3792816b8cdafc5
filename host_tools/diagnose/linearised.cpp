#include "host_tools/diagnose/linearised.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "host_tools/diagnose/base_parameters.hpp"
#include "host_tools/diagnose/design_matrix.hpp"
#include "host_tools/diagnose/encoder_error.hpp"
#include "host_tools/diagnose/features.hpp"
#include "host_tools/diagnose/load_places.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// White noise of which as much stays below a log's torque cut-off as a model leaves of its torques [N*m | N].
/// @param error of the model, at full rate
MatrixXd as_much_noise(const ProcessedLog& log, const MatrixXd& error, std::uint64_t seed) {
  const MatrixXd left = log.decimate(log.filter_columns(error));
  Eigen::RowVectorXd size(left.cols());
  for (Index j = 0; j < left.cols(); ++j) size[j] = robust_sigma(left.col(j));
  const double band = std::min(1.0, 2 * log.filter.torque_cutoff_hz * log.step_s);
  Random random(seed);
  MatrixXd out(error.rows(), error.cols());
  for (double& one : out.reshaped()) one = random.normal();
  return out * (size / std::sqrt(band)).asDiagonal();
}

}  // namespace

Linearised::Linearised(const Models& models, const std::vector<SessionLog>& logs, std::vector<VectorXd> whitening)
    : log_columns_(models, logs),
      unknowns_(make_unknowns(models)),
      groups_(unknowns_.named),
      background_(log_columns_.joints()) {
  const Blocks blocks = make_blocks(logs);
  solver_ = std::make_unique<BlockSolver>(blocks, design_matrix(log_columns_, unknowns_.all, blocks),
                                          static_cast<Index>(unknowns_.all.size()), unknowns_.priors());
  // A fit of both sessions would leave in the healthy one what today's gap bends the common parameters by.
  const std::vector<std::size_t> quiet = log_columns_.has_baseline() ? blocks.fit_of(true) : blocks.fit;
  noise_ = estimate_noise(log_columns_, *solver_, solver_->estimate_weights(quiet), quiet, std::move(whitening));
  parallel_for(joints(), [&](std::size_t j) { whiten(j); });
  const std::vector<std::size_t>& structured = log_columns_.background();
  parallel_for(structured.size(), [&](std::size_t k) { add_background(structured[k]); });
  solver_->estimate_weights();
  comparing_ = this->blocks().folds;
  const std::vector<Fold>& whole = blocks.whole_logs;
  if (whole.empty() || !all_of(whole, &Linearised::predicts_nuisance)) return;
  comparing_ = whole;
  if (all_of(whole, &Linearised::shows_named)) solver_->judge_by(whole);
}

bool Linearised::all_of(const std::vector<Fold>& folds, bool (Linearised::*holds)(const Fold&) const) const {
  return std::all_of(folds.begin(), folds.end(), [&](const Fold& fold) { return (this->*holds)(fold); });
}

bool Linearised::predicts_nuisance(const Fold& fold) const {
  MatrixXd none, fit, judge;
  VectorXd projection;
  solver_->normal(nuisance(), {}, none, projection);  // priors
  solver_->normal(nuisance(), fold.fit, fit, projection);
  solver_->normal(nuisance(), fold.judge, judge, projection);
  // Variance of the prediction, in noise variances, mean of the judge's rows.
  return (SymmetricSolver(fit).inverse() * (judge - none)).trace() <= solver_->row_count(fold.judge).sum();
}

bool Linearised::shows_named(const Fold& fold) const {
  const auto squares = [&](const Group& group, const std::vector<std::size_t>& of) {
    double sum = 0;
    for (std::size_t j = 0; j < joints(); ++j) {
      const JointRows& rows = solver_->rows(j);
      const double weight = solver_->weights()[static_cast<Index>(j)];
      VectorXd torque = VectorXd::Zero(rows.x.rows());
      for (Index c = group.first; c < group.first + group.count; ++c) {
        const Index local = rows.place(c);
        if (local >= 0) torque += rows.x.col(local) * unknowns_.all[static_cast<std::size_t>(c)].value;
      }
      for (const std::size_t b : of) {
        const Block& block = blocks().all[b];
        sum += weight * torque.segment(block.first, block.count).squaredNorm();
      }
    }
    return sum;
  };
  return std::all_of(unknowns_.named.begin(), unknowns_.named.end(), [&](const Group& group) {
    const double shown = squares(group, fold.fit);
    return shown >= options().gate.least_shown * (shown + squares(group, fold.judge));
  });
}

void Linearised::whiten(std::size_t joint) {
  MatrixXd x = solver_->rows(joint).x;
  VectorXd y = solver_->rows(joint).y;
  for (std::size_t l = 0; l < logs().size(); ++l) {
    const Block& b = blocks().of_log[l];
    x.middleRows(b.first, b.count) = noise_.apply(l, joint, x.middleRows(b.first, b.count));
    y.segment(b.first, b.count) = noise_.apply(l, joint, y.segment(b.first, b.count));
  }
  solver_->replace_rows(joint, std::move(x), std::move(y));
}

void Linearised::add_background(std::size_t joint) {
  MatrixXd functions = features(log_columns_, noise_, blocks(), joint, true);
  functions.conservativeResize(Eigen::NoChange, functions.cols() - time_features);
  auto background = std::make_unique<Background>(std::move(functions), blocks(), options().noise.background_prior);
  const JointRows& rows = solver_->rows(joint);
  const Index total = rows.x.rows();
  const MatrixXd x = background->eliminate(rows.x), y = background->eliminate(rows.y);
  solver_->replace_rows(joint, x.topRows(total), y.topRows(total), x.bottomRows(x.rows() - total),
                        y.bottomRows(y.rows() - total));
  background_[joint] = std::move(background);
}

std::vector<Index> Linearised::unknown_columns() const {
  std::vector<Index> out(unknowns_.all.size());
  std::iota(out.begin(), out.end(), Index{0});
  return out;
}

bool Linearised::rotor_is_separated(std::size_t joint, const std::vector<std::size_t>& groups) const {
  const auto separates = [&](std::size_t g) {
    const Group& group = groups_[g];
    return !group.on_body && group.candidate.joint == joint && separates_rotor(group.candidate.effect);
  };
  if (std::any_of(groups.begin(), groups.end(), separates)) return true;
  // What the model has of them beside the groups: a background's, a link encoder's.
  const auto& effects = log_columns_.joint(joint).effects;
  const auto all =
      std::count_if(effects.begin(), effects.end(), [](const EffectFit& fit) { return separates_rotor(fit.effect); });
  std::ptrdiff_t named = 0;
  for (std::size_t g = 0; g < groups_.size(); ++g) named += groups_[g].in_model && separates(g);
  return all > named;
}

std::vector<Index> Linearised::columns_of(const std::vector<std::size_t>& groups) const {
  std::vector<Index> out;
  for (const Index c : unknowns_.nuisance) {
    const Unknown& u = unknowns_.all[static_cast<std::size_t>(c)];
    if (u.kind != Unknown::Kind::rotor || rotor_is_separated(u.joint, groups)) out.push_back(c);
  }
  for (const std::size_t g : groups) {
    for (Index i = 0; i < groups_[g].count; ++i) out.push_back(groups_[g].first + i);
  }
  return out;
}

std::vector<MatrixXd> Linearised::make(const Group& group, bool in_both, const std::vector<VectorXd>& counts) const {
  std::vector<std::vector<MatrixXd>> of_log(logs().size(), std::vector<MatrixXd>(joints()));
  parallel_for(logs().size(), [&](std::size_t l) {
    if (logs()[l].healthy && !in_both) return;
    const ProcessedLog& log = logs()[l].log;
    EffectColumns full = log_columns_.of(l, group);
    for (std::size_t j = 0; j < joints(); ++j) {
      if (full.joints[j].size() > 0 && !counts.empty()) full.joints[j].array().colwise() *= counts[l].array();
      if (full.joints[j].size() > 0)
        of_log[l][j] = noise_.apply(l, j, log.decimate(log.filter_columns(full.joints[j])));
    }
  });
  std::vector<MatrixXd> out(joints());
  for (std::size_t l = 0; l < logs().size(); ++l) {
    const Block& b = blocks().of_log[l];
    for (std::size_t j = 0; j < joints(); ++j) {
      const MatrixXd& rows = of_log[l][j];
      if (rows.size() == 0) continue;
      if (out[j].size() == 0) out[j].setZero(blocks().rows(), rows.cols());
      out[j].middleRows(b.first, b.count) = rows;
    }
  }
  for (std::size_t j = 0; j < joints(); ++j) {
    if (out[j].size() > 0 && background_[j]) out[j] = background_[j]->eliminate(out[j]);
  }
  return out;
}

const std::vector<MatrixXd>& Linearised::load_columns() const {
  std::call_once(load_made_, [&] {
    load_.resize(joints());
    for (std::size_t l = 0; l < logs().size(); ++l) {
      if (logs()[l].healthy) continue;
      const ProcessedLog& log = logs()[l].log;
      const Block& b = blocks().of_log[l];
      const PointLoads loads(log_columns_, l);
      for (Index place = 0; place < moments_of_load; ++place) {
        const MatrixXd torque = loads.torque(place);
        for (std::size_t j = 0; j < joints(); ++j) {
          if (load_[j].size() == 0) load_[j].setZero(blocks().rows(), moments_of_load);
          load_[j].col(place).segment(b.first, b.count) =
              noise_.apply(l, j, log.decimate(log.filter_columns(torque.col(static_cast<Index>(j)))));
        }
      }
    }
    for (std::size_t j = 0; j < joints(); ++j) {
      load_[j] = load_[j] * moments_from_places();
      if (background_[j]) load_[j] = background_[j]->eliminate(load_[j]);
    }
  });
  return load_;
}

const Linearised* Linearised::through_encoders() const {
  std::call_once(seen_->made, [&] {
    seen_->logs = logs();
    bool any = false;
    for (std::size_t l = 0; l < seen_->logs.size(); ++l) {
      SessionLog& entry = seen_->logs[l];
      if (entry.healthy) continue;
      const std::optional<MotionRows> moved = see_again(entry.log);
      if (!moved) continue;
      any = true;
      entry.cache = std::make_shared<RowCache>();
      const MatrixXd error = entry.log.tau - log_columns_.torque_of(l, log_columns_.model(l));
      entry.log.tau = log_columns_.torque_along(l, *moved) + as_much_noise(entry.log, error, l + 1);
    }
    if (any) seen_->problem = std::make_unique<Linearised>(models(), seen_->logs, noise_.whitening());
  });
  return seen_->problem.get();
}

namespace {

Index most_columns(const std::vector<MatrixXd>& of_joints) {
  Index most = 0;
  for (const MatrixXd& c : of_joints) most = std::max(most, c.cols());
  return most;
}

}  // namespace

std::size_t Linearised::add(Group group, const std::vector<MatrixXd>& columns) {
  group.first = solver_->append({columns}).front();
  group.count = most_columns(columns);
  groups_.push_back(std::move(group));
  return groups_.size() - 1;
}

void Linearised::add_all(std::vector<Group> groups) {
  if (groups.empty()) return;
  std::vector<std::vector<MatrixXd>> made(groups.size());
  // Those that share something follow each other, so that it is needed once and for a while.
  const auto place = [&](std::size_t g) {
    const Group& group = groups[g];
    return group.on_body ? std::pair(joints(), 0.0) : std::pair(group.candidate.joint, group.rotor_inertia);
  };
  std::vector<std::size_t> order(groups.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return place(a) < place(b); });
  std::map<std::pair<std::size_t, double>, std::atomic<std::size_t>> left;
  for (const std::size_t g : order) ++left[place(g)];
  parallel_for(groups.size(), [&](std::size_t i) {
    const std::size_t g = order[i];
    made[g] = make(groups[g]);
    if (--left.at(place(g)) == 0 && !groups[g].on_body) log_columns_.forget_shared(groups[g].candidate.joint);
  });
  for (std::size_t g = 0; g < groups.size(); ++g) groups[g].count = most_columns(made[g]);
  const std::vector<Index> first = solver_->append(std::move(made));
  for (std::size_t g = 0; g < groups.size(); ++g) groups[g].first = first[g];
  groups_.insert(groups_.end(), groups.begin(), groups.end());
}

MatrixXd base_covariance(const Linearised& problem) {
  const Index n = problem.log_columns().base_parameters();
  const LinearFit fit = problem.solver().solve(problem.unknown_columns());
  return SymmetricSolver(fit.information).inverse().topLeftCorner(n, n);
}

std::vector<std::size_t> in_model(const Linearised& problem) {
  std::vector<std::size_t> groups;
  for (std::size_t g = 0; g < problem.groups().size(); ++g) {
    if (problem.groups()[g].in_model) groups.push_back(g);
  }
  return groups;
}

}  // namespace fxdyn::diagnosis
