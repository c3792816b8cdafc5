#include "host_tools/diagnose/log_columns.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "host_tools/diagnose/models.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// All that robot_with() keeps [bytes]: enough for every rotor of a session of usual length.
constexpr double most_kept = 96e6;
/// Slopes by the states of all joints [bytes] that are kept between candidates of different joints.
constexpr double most_slopes = 64e6;

namespace {

/// Of a motion below a cut-off [Hz].
Motion slow_part(const Motion& all, double cutoff) {
  const ZeroPhaseFilter filter(cutoff, all.step_s);
  return {all.name, all.step_s, all.t, filter.apply(all.q), filter.apply(all.dq), filter.apply(all.ddq)};
}

/// @param slow null: gears bend by all of the motion
MatrixXd torque_of_both(const IdentifiedModel& model, const Motion& all, const Motion* slow) {
  const auto torque = [](const IdentifiedModel& m, const Motion& motion) {
    return fxdyn::predict(m, motion.q, motion.dq, motion.ddq, motion.step_s);
  };
  const auto stiff = slow != nullptr ? stiffened(model) : std::nullopt;
  if (!stiff) return torque(model, all);
  return torque(*stiff, all) + torque(model, *slow) - torque(*stiff, *slow);
}

}  // namespace

LogColumns::LogColumns(const Models& models, const std::vector<SessionLog>& logs)
    : models_(std::make_shared<const Models>(models)),
      logs_(&logs),
      chain_(to_dh(robot_of(models.current))),
      base_(base_set_of(models.current)),
      motions_(logs.size()),
      slow_(logs.size()),
      robot_(logs.size()) {
  parallel_for(logs.size(), [&](std::size_t l) {
    const ProcessedLog& log = logs[l].log;
    RowCache& cache = *logs[l].cache;
    std::call_once(cache.moved, [&] {
      MotionRows m = log.motion();
      cache.motion =
          std::make_unique<Motion>(log.name, log.step_s, log.t, std::move(m.q), std::move(m.dq), std::move(m.ddq));
      if (const double cutoff = logs[l].bending_hz; cutoff > 0)
        cache.slow = std::make_unique<Motion>(slow_part(*cache.motion, cutoff));
    });
    motions_[l] = cache.motion.get();
    slow_[l] = cache.slow.get();
    robot_[l] = std::make_shared<RobotColumns>(with_load_of(log, model(l)), *motions_[l]);
  });
}

const Options& LogColumns::options() const { return models_->options; }
std::size_t LogColumns::joints() const { return joints_of(models_->current).size(); }
bool LogColumns::has_baseline() const { return models_->has_baseline; }
const std::vector<std::size_t>& LogColumns::background() const { return models_->background; }
const IdentifiedModel& LogColumns::current() const { return models_->current; }
const Joint& LogColumns::joint_of_robot(std::size_t joint) const { return robot_of(current()).joints[joint]; }
const JointFit& LogColumns::joint(std::size_t joint) const { return joints_of(current())[joint]; }
const IdentifiedModel& LogColumns::model(std::size_t log) const { return models_->of((*logs_)[log].healthy); }
const JointFit& LogColumns::joint(std::size_t log, std::size_t joint) const { return joints_of(model(log))[joint]; }
bool LogColumns::bends_slowly(std::size_t log) const { return slow_[log] && stiffened(model(log)); }

Index LogColumns::first_base(std::size_t joint) const {
  const auto first = std::lower_bound(base_.columns.begin(), base_.columns.end(),
                                      static_cast<Index>(joint) * static_cast<Index>(parameters_per_link));
  return first - base_.columns.begin();
}

/// Of some samples at full rate, the joints' columns side by side.
MatrixXd LogColumns::base_columns(std::size_t log, const std::vector<std::size_t>& of, Index begin,
                                  Index samples) const {
  const Motion& motion = *motions_[log];
  const Index nb = base_parameters();
  Index columns = 0;
  for (const std::size_t j : of) columns += nb - first_base(j);
  MatrixXd out(samples, columns);
  Regressor regressor(chain_);
  for (Index k = 0; k < samples; ++k) {
    const Index at = begin + k;
    const MatrixXd& y = regressor(motion.q.row(at), motion.dq.row(at), motion.ddq.row(at));
    Index i = 0;
    for (const std::size_t j : of) {
      for (Index c = first_base(j); c < nb; ++c)
        out(k, i++) = y(static_cast<Index>(j), base_.columns[static_cast<std::size_t>(c)]);
    }
  }
  return out;
}

MatrixXd LogColumns::base_rows(std::size_t log, std::size_t joint) const {
  const SessionLog& entry = (*logs_)[log];
  RowCache& cache = *entry.cache;
  std::call_once(cache.made, [&] {
    std::vector<std::size_t> all(joints());
    std::iota(all.begin(), all.end(), std::size_t{0});
    for (const std::size_t j : all) cache.base.emplace_back(entry.log.rows(), base_parameters() - first_base(j));
    // Block by block: at full rate the columns of all joints are ten times the log.
    for (const RowBlock& block : row_blocks(entry.log)) {
      const MatrixXd kept = block.filter_and_keep(entry.log, base_columns(log, all, block.begin, block.samples));
      Index from = 0;
      for (MatrixXd& rows : cache.base) {
        rows.middleRows(block.row, block.rows) = kept.middleCols(from, rows.cols());
        from += rows.cols();
      }
    }
    cache.features.resize(joints());
  });
  if (in_order(joints_of(model(log))[joint], true).empty()) return cache.base[joint];
  const MatrixXd columns = follow(log, joint, base_columns(log, {joint}, 0, entry.log.samples()));
  return entry.log.decimate(entry.log.filter_columns(columns));
}

MatrixXd LogColumns::follow(std::size_t log, std::size_t joint, MatrixXd columns) const {
  for (const EffectFit* effect : in_order(joints_of(model(log))[joint], true)) {
    const double share = effect->linear[0];
    if (find_effect(effect->effect)->of_total == OfTotal::clips) {
      const auto torque = robot_[log]->torque().col(static_cast<Index>(joint)).array().abs();
      const Eigen::ArrayXd pass =
          (torque < effect->shape[0] * (1 - 1e-9)).select(Eigen::ArrayXd::Ones(torque.size()), 1 - share);
      columns = pass.matrix().asDiagonal() * columns;
      continue;
    }
    for (Index c = 0; c < columns.cols(); ++c) {
      JointSeries series{columns.col(c), columns.col(c), columns.col(c), {}, (*logs_)[log].log.step_s};
      series.total = columns.col(c);
      columns.col(c) += share * effect_columns(effect->effect, effect->shape, 1, series);
    }
  }
  return columns;
}

EffectColumns LogColumns::of(std::size_t log, const EffectCandidate& candidate, const RobotColumns& columns) const {
  const EffectInfo& info = *find_effect(candidate.effect);
  if (info.acts_on != ActsOn::torque || info.needs_total) return columns(candidate);
  EffectColumns out;
  out.joints.resize(joints());
  MatrixXd& own = out.joints[candidate.joint];
  own = columns.phi(candidate);
  if (info.drifts() && (*logs_)[log].age_s > 0) {
    // w(t + age) = w(t) + (1 - w(t)) w(age)
    const double w = -std::expm1(-(*logs_)[log].age_s / candidate.shape[0]);
    MatrixXd warm(own.rows(), 2);
    warm << columns.phi({std::string(info.warms_into[0]), candidate.joint, {}}),
        columns.phi({std::string(info.warms_into[1]), candidate.joint, {}});
    own = (1 - w) * own + w * warm;
  }
  own = follow(log, candidate.joint, std::move(own));
  return out;
}

EffectColumns LogColumns::of(std::size_t log, const Group& group) const {
  return of(log, group.candidate, *robot_with(log, group));
}

/// Around a model in which some of a joint's inertia is its rotor's: the same torque, but another load on the gear.
/// What bends is of the motion that is not noise.
std::shared_ptr<const RobotColumns> LogColumns::robot_with(std::size_t log, const Group& group) const {
  const bool rotor = group.rotor && group.rotor_inertia != 0, slow = slow_[log] && bends(group.candidate.effect);
  if (!rotor && !slow) return robot_[log];
  const std::tuple key(log, rotor ? group.candidate.joint : 0, rotor ? group.rotor_inertia : 0.0, slow);
  {
    const std::lock_guard lock(for_group_mutex_);
    if (const auto known = for_group_.find(key); known != for_group_.end()) return known->second;
  }
  ModelValue model = models_->current;
  if (rotor) {
    EffectFit fit;
    fit.effect = rotor_effect().name;
    fit.linear = {group.rotor_inertia};
    joints_of(model)[group.candidate.joint].effects.push_back(std::move(fit));
    take_from_base(model, group.rotor->in_base, group.rotor_inertia);
  }
  auto made = std::make_shared<const RobotColumns>(with_load_of((*logs_)[log].log, std::move(model)),
                                                   slow ? *slow_[log] : *motions_[log]);
  const std::lock_guard lock(for_group_mutex_);
  // Those of a long log are made again rather than kept for every rotor; whoever uses one holds it.
  // Two torques, and slopes by three states.
  const auto bytes = static_cast<double>(5 * sizeof(double) * made->torque().size());
  if (bytes * static_cast<double>(for_group_.size() + 1) > most_kept) for_group_.clear();
  return for_group_.emplace(key, std::move(made)).first->second;
}

void LogColumns::forget_shared(std::size_t joint) const {
  double slopes = 0;
  for (const Motion* motion : motions_)
    slopes += static_cast<double>(3 * sizeof(double) * joints()) * static_cast<double>(motion->q.size());
  if (slopes <= most_slopes) return;
  for (const auto& robot : robot_) robot->forget_slopes(joint);
  const std::lock_guard lock(for_group_mutex_);
  for_group_.clear();
}

MatrixXd LogColumns::torque_of(std::size_t log, ModelValue model) const {
  return torque_of_both(with_load_of((*logs_)[log].log, std::move(model)), *motions_[log], slow_[log]);
}

MatrixXd LogColumns::torque_along(std::size_t log, const MotionRows& motion) const {
  const SessionLog& entry = (*logs_)[log];
  const Motion all{entry.log.name, entry.log.step_s, entry.log.t, motion.q, motion.dq, motion.ddq};
  std::optional<Motion> slow;
  if (slow_[log]) slow = slow_part(all, entry.bending_hz);
  return torque_of_both(with_load_of(entry.log, model(log)), all, slow ? &*slow : nullptr);
}

}  // namespace fxdyn::diagnosis
