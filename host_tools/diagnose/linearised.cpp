#include "host_tools/diagnose/linearised.hpp"

#include <cmath>
#include <numbers>
#include <numeric>

#include "host_tools/diagnose/autoregression.hpp"
#include "host_tools/diagnose/lack_of_fit.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"
#include "model/effects/coulomb.hpp"
#include "model/effects/offset.hpp"
#include "model/effects/payload.hpp"
#include "model/effects/rotor_inertia.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Friction differs from session to session by this share of itself (standard deviation) without anything being wrong.
constexpr double friction_change = 0.3;
/// Likewise the offset, as a share of Coulomb friction.
constexpr double offset_change = 0.05;
/// What a parameter that is zero may change by, of rated torque.
constexpr double smallest_change = 1e-3;
/// What a rotor may have of the inertia that rated torque and largest acceleration stand for (standard deviation).
constexpr double rotor_share = 0.3;
/// A share that is 1 by definition.
constexpr double share_std = 1e-3;
constexpr double difference = 1e-3;
constexpr int blocks_of_one_log = 5;

bool is_shape_free(const EffectInfo& info, std::size_t i) {
  // A time constant from one session's start is a guess by its end: the gate chooses it.
  return info.shape[i].name != "joint" && info.shape[i].name != "ratio" && info.shape[i].name != "time_constant";
}

/// Columns that come from differences of predict() rather than from phi.
bool by_difference(const EffectInfo& info) {
  return info.acts_on != ActsOn::torque || info.needs_total || info.needs_structural;
}

/// The unknown as it lies in the healthy model.
Unknown in_healthy(Unknown u) {
  u.effect = u.healthy_effect;
  return u;
}

const EffectFit& fit_of(const IdentifiedModel& model, const Unknown& u) {
  return u.body ? model.body[u.effect] : model.joints[u.joint].effects[u.effect];
}

double& value_of(IdentifiedModel& model, const Unknown& u) {
  EffectFit& fit = u.body ? model.body[u.effect] : model.joints[u.joint].effects[u.effect];
  return u.kind == Unknown::Kind::shape ? fit.shape[u.index] : fit.linear[u.index];
}

bool is_moment(const EffectFit& fit, const Unknown& u) {
  return fit.effect == Payload::name && u.kind == Unknown::Kind::linear && u.index > 0;
}

/// Value of an unknown in a model: payload's centre counts as first moment.
double read(const IdentifiedModel& model, const Unknown& u) {
  const EffectFit& fit = fit_of(model, u);
  return is_moment(fit, u) ? fit.linear[0] * fit.linear[u.index] : fit.linear[u.index];
}

void add_to(IdentifiedModel& model, const Unknown& u, double step) {
  switch (u.kind) {
    case Unknown::Kind::base:
      add_to_base(model, u.index, step);
      return;
    case Unknown::Kind::rotor:
      value_of(model, u) += step;
      take_from_base(model, u.in_base, step);
      return;
    case Unknown::Kind::width:
      model.joints[u.joint].sign_width *= std::exp(step);
      return;
    case Unknown::Kind::shape: {
      const ParameterInfo& info = find_effect(fit_of(model, u).effect)->shape[u.index];
      double& value = value_of(model, u);
      value = std::clamp(value * std::exp(step), std::max(info.lower, u.lower), std::min(info.upper, u.upper));
      return;
    }
    case Unknown::Kind::linear: {
      const EffectFit& fit = fit_of(model, u);
      if (is_moment(fit, u)) {
        value_of(model, u) += step / fit.linear[0];
      } else {
        value_of(model, u) += step;
      }
      return;
    }
  }
}

}  // namespace

Linearised::Linearised(const Models& models, const std::vector<SessionLog>& logs, std::vector<VectorXd> whitening)
    : models_(models), logs_(&logs), whitening_(std::move(whitening)) {
  chain_ = to_dh(models_.current.robot);
  base_ = base_of(models_.current);
  rows_.resize(models_.current.joints.size());
  weights_ = VectorXd::Ones(static_cast<Index>(rows_.size()));
  motions_.resize(logs.size());
  slow_.resize(logs.size());
  background_.resize(rows_.size());
  robot_.resize(logs.size());
  parallel_for(logs.size(), [&](std::size_t l) {
    const ProcessedLog& log = logs[l].log;
    MotionRows m = log.motion();
    motions_[l] = std::make_unique<Motion>(
        Motion{log.name, log.step_s, log.t, std::move(m.q), std::move(m.dq), std::move(m.ddq)});
    if (const double cutoff = logs[l].bending_hz; cutoff > 0) {
      const Motion& all = *motions_[l];
      const ZeroPhaseFilter filter(cutoff, log.step_s);
      slow_[l] = std::make_unique<Motion>(
          Motion{all.name, all.step_s, all.t, filter.apply(all.q), filter.apply(all.dq), filter.apply(all.ddq)});
    }
    robot_[l] = std::make_shared<RobotColumns>(with_load_of(log, logs[l].healthy ? models_.healthy : models_.current),
                                               *motions_[l]);
  });
  make_blocks();
  make_unknowns();
  make_rows();
}

void Linearised::make_blocks() {
  Index at = 0;
  std::size_t fitting = 0;
  bool judged = false;
  for (const SessionLog& entry : *logs_) {
    fitting += !entry.healthy && entry.fits;
    judged |= !entry.fits;
  }
  for (std::size_t l = 0; l < logs_->size(); ++l) {
    const SessionLog& entry = (*logs_)[l];
    const Index count = entry.log.rows();
    log_rows_.push_back({l, at, count, entry.healthy, entry.fits});
    const int parts = !judged && fitting == 1 && !entry.healthy ? blocks_of_one_log : 1;
    for (int part = 0; part < parts; ++part) {
      const Index from = count * part / parts, to = count * (part + 1) / parts;
      blocks_.push_back({l, at + from, to - from, entry.healthy, entry.fits});
    }
    at += count;
  }
  Fold all;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    if (blocks_[b].fits) fit_blocks_.push_back(b);
  }
  if (judged) {
    all.fit = fit_blocks_;
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      if (!blocks_[b].fits) all.judge.push_back(b);
    }
    folds_.push_back(all);
    return;
  }
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    if (blocks_[b].healthy) continue;
    Fold fold;
    fold.judge = {b};
    for (const std::size_t other : fit_blocks_) {
      if (other != b) fold.fit.push_back(other);
    }
    folds_.push_back(fold);
  }
}

std::pair<double, double> shape_limits(const Models& models, std::size_t joint, const EffectInfo& info,
                                       const ParameterInfo& shape) {
  const FilterFit& filter = models.current.filter;
  if (shape.values.seen_by_encoder && joint < filter.position_noise.size()) {
    const double step = std::max(filter.encoder_step[joint], std::sqrt(12.0) * filter.position_noise[joint]);
    return {std::clamp(step, shape.lower, 0.1 * shape.upper), shape.upper};
  }
  return {shape.lower, upper_bound(info, shape, models.smallest_step_s)};
}

void Linearised::make_unknowns() {
  const IdentifiedModel& now = models_.current;
  const bool two = models_.has_baseline;
  const auto is_in = [](const std::vector<EffectCandidate>& list, std::size_t j, const EffectFit& fit) {
    return std::any_of(list.begin(), list.end(),
                       [&](const EffectCandidate& c) { return c.joint == j && c.effect == fit.effect; });
  };
  const auto fixed = [&](std::size_t j, const EffectFit& fit) { return is_in(models_.fixed, j, fit); };
  const IdentifiedModel& common = two ? models_.healthy : now;
  for (std::size_t k = 0; k < now.base.size(); ++k) {
    Unknown u;
    u.index = k;
    u.value = now.base[k].value;
    unknowns_.push_back(u);
  }
  for (std::size_t j = 0; j < now.joints.size(); ++j) {
    const JointFit& joint = now.joints[j];
    bool signs = false;
    for (const EffectFit& fit : joint.effects) signs |= !fit.named && find_effect(fit.effect)->uses_sign;
    if (signs) {
      Unknown u;
      u.kind = Unknown::Kind::width;
      u.joint = j;
      unknowns_.push_back(u);
    }
    const EffectFit* coulomb = common.joints[j].find(Coulomb::name);
    std::size_t unnamed = 0;
    for (std::size_t e = 0; e < joint.effects.size(); ++e) {
      const EffectFit& fit = joint.effects[e];
      if (fit.named) continue;
      const std::size_t before = two ? unnamed++ : e;  // both models have the unnamed ones in one order
      if (fixed(j, fit) || is_in(models_.held, j, fit)) continue;
      const EffectInfo& info = *find_effect(fit.effect);
      Unknown u;
      u.joint = j;
      u.effect = e;
      u.healthy_effect = before;
      for (u.index = 0; u.index < info.linear.size(); ++u.index) {
        u.kind = Unknown::Kind::linear;
        u.change = false;
        u.prior_std = 0;
        u.value = common.joints[j].effects[before].linear[u.index];
        const auto rotor = std::find_if(models_.rotors.begin(), models_.rotors.end(),
                                        [&](const Rotor& r) { return r.joint == j && in_base(fit.effect); });
        if (rotor != models_.rotors.end()) {
          // Where the load is inertia alone nothing tells them apart.
          u.kind = Unknown::Kind::rotor;
          u.in_base = rotor->in_base;
          u.prior = rotor->inertia;
          u.prior_std =
              rotor->std > 0 ? rotor->std : rotor_share * joint.rated_torque / std::max(joint.ddq_limit, 1e-9);
        }
        unknowns_.push_back(u);
        u.prior_std = 0;
        if (!two || in_base(fit.effect)) continue;
        u.change = true;
        // Of motions of unit size: a coefficient's own scale.
        double scale = friction_change * std::fabs(u.value);
        if (fit.effect == Offset::name && coulomb != nullptr) scale += offset_change * std::fabs(coulomb->linear[0]);
        const double motion = info.linear[u.index].quantity == Quantity::velocity ? joint.dq_limit : 1.0;
        u.prior_std = std::hypot(scale, smallest_change * joint.rated_torque / std::max(motion, 1e-9));
        u.value = fit.linear[u.index] - u.value;
        unknowns_.push_back(u);
      }
      u.change = false;
      u.prior_std = 0;
      u.value = 0;
      u.kind = Unknown::Kind::shape;
      for (u.index = 0; u.index < info.shape.size(); ++u.index) {
        std::tie(u.lower, u.upper) = shape_limits(models_, j, info, info.shape[u.index]);
        if (is_shape_free(info, u.index)) unknowns_.push_back(u);
      }
    }
  }
  for (Index i = 0; i < static_cast<Index>(unknowns_.size()); ++i) nuisance_.push_back(i);
  const auto named = [&](const EffectFit& fit, std::size_t j, std::size_t e, bool body) {
    const EffectInfo& info = *find_effect(fit.effect);
    Group group;
    group.candidate = {fit.effect, j, fit.shape};
    group.on_body = body;
    group.in_model = true;
    group.id = {body, j, e};
    group.first = static_cast<Index>(unknowns_.size());
    Unknown u;
    u.joint = j;
    u.effect = e;
    u.body = body;
    u.kind = Unknown::Kind::linear;
    for (u.index = 0; u.index < info.linear.size(); ++u.index) {
      u.value = 0;
      u.prior = u.prior_std = 0;
      u.value = read(now, u);
      if (info.linear[u.index].name == "share") {
        u.prior = 1;
        u.prior_std = share_std;
      }
      unknowns_.push_back(u);
      group.lower.push_back(info.linear[u.index].lower);
    }
    u.kind = Unknown::Kind::shape;
    u.value = u.prior = u.prior_std = 0;
    for (u.index = 0; u.index < info.shape.size(); ++u.index) {
      if (!is_shape_free(info, u.index)) continue;
      std::tie(u.lower, u.upper) = shape_limits(models_, j, info, info.shape[u.index]);
      unknowns_.push_back(u);
      ++group.nonlinear;
      group.lower.push_back(-1e300);
    }
    group.count = static_cast<Index>(unknowns_.size()) - group.first;
    groups_.push_back(std::move(group));
  };
  for (std::size_t j = 0; j < now.joints.size(); ++j) {
    for (std::size_t e = 0; e < now.joints[j].effects.size(); ++e) {
      if (now.joints[j].effects[e].named && !fixed(j, now.joints[j].effects[e]))
        named(now.joints[j].effects[e], j, e, false);
    }
  }
  for (std::size_t e = 0; e < now.body.size(); ++e) {
    if (now.body[e].named) named(now.body[e], 0, e, true);
  }
  columns_ = static_cast<Index>(unknowns_.size());
}

std::vector<Index> Linearised::columns_of(const std::vector<std::size_t>& groups) const {
  const auto told = [&](std::size_t joint) {
    const auto tells = [&](std::size_t g) {
      const Group& group = groups_[g];
      return !group.on_body && group.candidate.joint == joint && tells_rotor(group.candidate.effect);
    };
    if (std::any_of(groups.begin(), groups.end(), tells)) return true;
    // What the model has of them beside the groups: a background's, a link encoder's.
    const auto& effects = models_.current.joints[joint].effects;
    const auto all =
        std::count_if(effects.begin(), effects.end(), [](const EffectFit& fit) { return tells_rotor(fit.effect); });
    std::ptrdiff_t named = 0;
    for (std::size_t g = 0; g < groups_.size(); ++g) named += groups_[g].in_model && tells(g);
    return all > named;
  };
  std::vector<Index> out;
  for (const Index c : nuisance_) {
    const Unknown& u = unknowns_[static_cast<std::size_t>(c)];
    if (u.kind != Unknown::Kind::rotor || told(u.joint)) out.push_back(c);
  }
  for (const std::size_t g : groups) {
    for (Index i = 0; i < groups_[g].count; ++i) out.push_back(groups_[g].first + i);
  }
  return out;
}

MatrixXd Linearised::follow(std::size_t log, std::size_t joint, MatrixXd columns) const {
  const SessionLog& entry = (*logs_)[log];
  const JointFit& fit = (entry.healthy ? models_.healthy : models_.current).joints[joint];
  for (const EffectFit* effect : in_order(fit, true)) {
    const double share = effect->linear[0];
    if (find_effect(effect->effect)->of_total == OfTotal::clips) {
      const auto torque = robot_[log]->torque().col(static_cast<Index>(joint)).array().abs();
      const Eigen::ArrayXd pass =
          (torque < effect->shape[0] * (1 - 1e-9)).select(Eigen::ArrayXd::Ones(torque.size()), 1 - share);
      columns = pass.matrix().asDiagonal() * columns;
      continue;
    }
    for (Index c = 0; c < columns.cols(); ++c) {
      JointSeries series{columns.col(c), columns.col(c), columns.col(c), {}, entry.log.step_s};
      series.total = columns.col(c);
      columns.col(c) += share * effect_columns(effect->effect, effect->shape, 1, series);
    }
  }
  return columns;
}

EffectColumns Linearised::full_rate(std::size_t log, const EffectCandidate& candidate, const RobotColumns& of) const {
  const EffectInfo& info = *find_effect(candidate.effect);
  if (info.acts_on != ActsOn::torque || info.needs_total) return of(candidate);
  EffectColumns out;
  out.joints.resize(joints());
  out.joints[candidate.joint] = of.phi(candidate);
  if (info.drifts() && (*logs_)[log].age_s > 0) {
    // w(t + age) = w(t) + (1 - w(t)) w(age)
    const double w = -std::expm1(-(*logs_)[log].age_s / candidate.shape[0]);
    MatrixXd warm(out.joints[candidate.joint].rows(), 2);
    warm << of.phi({std::string(info.warms_into[0]), candidate.joint, {}}),
        of.phi({std::string(info.warms_into[1]), candidate.joint, {}});
    out.joints[candidate.joint] = (1 - w) * out.joints[candidate.joint] + w * warm;
  }
  out.joints[candidate.joint] = follow(log, candidate.joint, std::move(out.joints[candidate.joint]));
  return out;
}

MatrixXd Linearised::prepare(std::size_t log, std::size_t joint, const Eigen::Ref<const MatrixXd>& full) const {
  const ProcessedLog& l = (*logs_)[log].log;
  return finish(log, joint, l.decimate(l.filter_columns(full)));
}

MatrixXd Linearised::finish(std::size_t log, std::size_t joint, const MatrixXd& rows) const {
  const Block& b = log_rows_[log];
  return row_scale_[joint].segment(b.first, b.count).asDiagonal() * whiten(joint, rows);
}

double Linearised::doubtful(std::size_t joint) const {
  const auto half = (row_scale_[joint].array() < std::sqrt(0.5)).count();
  return static_cast<double>(half) / static_cast<double>(row_scale_[joint].size());
}

double Linearised::log_scale(std::size_t joint) const {
  double sum = 0;
  for (const std::size_t b : fit_blocks_)
    sum += row_scale_[joint].segment(blocks_[b].first, blocks_[b].count).array().log().sum();
  return sum;
}

/// Near standstill the friction that an uncertain velocity makes is noise too. Its variance in units of the noise,
///   u = E[(tau(dq + sigma_dq n) - tau(dq))^2] / sigma^2, n of variance 1:
/// while sigma_dq is small beside the sign's width its slope counts; else the chance of the wrong sign,
///   4 F^2 Phi(-|dq| / sigma_dq), F the friction that turns with it.
/// A joint that stands still (|dq| < sigma_dq) bears any friction up to F, and for as long: its rows have one error
/// between them, so that of N rows each counts like one of N times the variance.
/// sigma_dq is what the position filter leaves of the encoder's noise. An encoder that steps more slowly than the
/// filter is a staircase, no white noise: its velocity is wrong by sqrt(2) cutoff step.
VectorXd Linearised::doubt(std::size_t log, std::size_t joint, double sigma) const {
  const SessionLog& entry = (*logs_)[log];
  const ProcessedLog& l = entry.log;
  const JointFit& fit = (entry.healthy ? models_.healthy : models_.current).joints[joint];
  const EffectFit* coulomb = fit.find(Coulomb::name);
  const double step = l.filter.encoder_step[joint],
               noise = std::max(l.filter.position_noise[joint], step / std::sqrt(12.0));
  if (coulomb == nullptr || l.measured_dq.size() > 0 || !(noise > 0)) return VectorXd::Zero(l.rows());
  // Twice white noise's: an encoder at standstill repeats its error.
  const double cutoff = std::min(l.filter.position_cutoff_hz, 0.5 / l.step_s);
  const double white = 2 * 2 * std::numbers::pi * noise * std::sqrt(2 * l.step_s * cutoff * cutoff * cutoff / 3);
  const double width = fit.sign_width, slow = cutoff * step;
  // All friction that turns with the sign, some of it in proportion to the load.
  double amplitude = std::fabs(coulomb->linear[0]), of_load = 0;
  for (const EffectInfo& info : effect_infos()) {
    const EffectFit* more = info.nominal ? nullptr : fit.find(info.name);
    if (more == nullptr || info.turns_with_sign == TurnsWithSign::no) continue;
    (info.turns_with_sign == TurnsWithSign::load ? of_load : amplitude) += std::fabs(more->linear[0]);
  }
  VectorXd uncertain(l.samples());
  Index still = 0;  // samples so far
  const auto come_loose = [&](Index at) {
    if (still > l.decimation)
      uncertain.segment(at - still, still) *= static_cast<double>(still) / static_cast<double>(l.decimation);
    still = 0;
  };
  for (Index k = 0; k < l.samples(); ++k) {
    const double dq = std::fabs((*motions_[log]).dq(k, static_cast<Index>(joint)));
    const double stairs = slow > 0 ? slow * std::exp(-0.125 * dq * dq / (slow * slow)) : 0;
    const double s = std::sqrt(white * white + 2 * stairs * stairs);
    // the mean slope over what the velocity may be
    const double slope = 0.5 * (std::tanh((dq + s) / width) - std::tanh((dq - s) / width));
    const double wrong = std::min(1.0, s * s / (width * width)) * 2 * std::erfc(dq / (s * std::numbers::sqrt2));
    const double load = std::fabs(robot_[log]->structural()(k, static_cast<Index>(joint)));
    const double friction = (amplitude + of_load * load) / sigma;
    uncertain[k] = friction * friction * std::max(slope * slope, wrong);
    if (dq < s) {
      ++still;
    } else {
      come_loose(k);
    }
  }
  come_loose(l.samples());
  return l.decimate(l.filter_columns(uncertain)).col(0).cwiseMax(0);
}

/// Rows of one log.
MatrixXd Linearised::whiten(std::size_t joint, MatrixXd columns) const {
  return whitening_.empty() ? columns : prewhitened(columns, whitening_[joint]);
}

Index Linearised::first_base(std::size_t joint) const {
  const auto at = std::lower_bound(base_.columns.begin(), base_.columns.end(),
                                   static_cast<Index>(joint) * static_cast<Index>(parameters_per_link));
  return at - base_.columns.begin();
}

/// Base columns of a joint at full rate.
std::vector<MatrixXd> Linearised::base_columns(std::size_t log, const std::vector<std::size_t>& of) const {
  const Motion& motion = *motions_[log];
  const auto nb = static_cast<Index>(base_.columns.size());
  std::vector<MatrixXd> out(joints());
  for (const std::size_t j : of) out[j].resize(motion.q.rows(), nb - first_base(j));
  Regressor regressor(chain_);
  for (Index k = 0; k < motion.q.rows(); ++k) {
    const MatrixXd& y = regressor(motion.q.row(k), motion.dq.row(k), motion.ddq.row(k));
    for (const std::size_t j : of) {
      for (Index c = first_base(j), i = 0; c < nb; ++c, ++i)
        out[j](k, i) = y(static_cast<Index>(j), base_.columns[static_cast<std::size_t>(c)]);
    }
  }
  return out;
}

/// Base columns of a joint as its torque shows them, through what follows in its path; filtered and decimated. What
/// depends on the load (friction, a gear that bends) is its own columns' alone, so that it goes with them.
MatrixXd Linearised::base_rows(std::size_t log, std::size_t joint) const {
  const SessionLog& entry = (*logs_)[log];
  RowCache& cache = *entry.cache;
  std::call_once(cache.made, [&] {
    std::vector<std::size_t> all(joints());
    std::iota(all.begin(), all.end(), std::size_t{0});
    for (const MatrixXd& full : base_columns(log, all))
      cache.base.push_back(entry.log.decimate(entry.log.filter_columns(full)));
    cache.features.resize(joints());
  });
  const JointFit& fit = (entry.healthy ? models_.healthy : models_.current).joints[joint];
  if (in_order(fit, true).empty()) return cache.base[joint];
  MatrixXd columns = follow(log, joint, std::move(base_columns(log, {joint})[joint]));
  return entry.log.decimate(entry.log.filter_columns(columns));
}

void Linearised::make_rows() {
  const std::size_t n = joints();
  const Index total = log_rows_.back().first + log_rows_.back().count;
  const auto nb = static_cast<Index>(base_.columns.size());
  // Which unknowns each joint feels: its base columns, its own, and everything that is not an effect on its torque.
  for (std::size_t j = 0; j < n; ++j) {
    JointRows& rows = rows_[j];
    for (Index c = first_base(j); c < nb; ++c) rows.column.push_back(c);
    for (Index c = nb; c < columns_; ++c) {
      const Unknown& u = unknowns_[static_cast<std::size_t>(c)];
      bool felt = u.joint == j && !u.body;
      if (u.kind != Unknown::Kind::width) {
        const EffectInfo& info = *find_effect(fit_of(models_.current, u).effect);
        felt |= u.body || info.acts_on != ActsOn::torque || u.kind == Unknown::Kind::rotor;
      }
      if (felt) rows.column.push_back(c);
    }
    rows.local.assign(static_cast<std::size_t>(columns_), -1);
    for (std::size_t i = 0; i < rows.column.size(); ++i)
      rows.local[static_cast<std::size_t>(rows.column[i])] = static_cast<Index>(i);
    rows.x.setZero(total, static_cast<Index>(rows.column.size()));
    rows.y.setZero(total);
  }
  parallel_for(logs_->size(), [&](std::size_t l) {
    const SessionLog& entry = (*logs_)[l];
    const ProcessedLog& log = entry.log;
    const IdentifiedModel& model = entry.healthy ? models_.healthy : models_.current;
    const Motion& motion = *motions_[l];
    const Index at = log_rows_[l].first, count = log_rows_[l].count;
    std::vector<MatrixXd> full(n);  // everything but the base columns, and the prediction
    for (std::size_t j = 0; j < n; ++j) {
      full[j].setZero(log.samples(), static_cast<Index>(rows_[j].column.size()) - (nb - first_base(j)) + 1);
      rows_[j].x.block(at, 0, count, nb - first_base(j)) = base_rows(l, j);
    }
    const bool bends_slowly = slow_[l] && stiffened(model);  // then predict() is not all there is
    const MatrixXd torque = bends_slowly ? torque_of(l, model) : robot_[l]->torque();
    MatrixXd predicted = torque;
    for (Index c = nb; c < columns_; ++c) {
      const Unknown& common = unknowns_[static_cast<std::size_t>(c)];
      const bool named = common.kind != Unknown::Kind::width && fit_of(models_.current, common).named;
      if (entry.healthy && (common.change || named)) continue;
      const Unknown u = entry.healthy ? in_healthy(common) : common;
      std::vector<MatrixXd> columns(n);
      if (u.kind == Unknown::Kind::width) {
        // d / d log w of everything that uses the sign
        IdentifiedModel wide = model, narrow = model;
        wide.joints[u.joint].sign_width *= 1 + difference;
        narrow.joints[u.joint].sign_width *= 1 - difference;
        JointSeries series{motion.q.col(static_cast<Index>(u.joint)), motion.dq.col(static_cast<Index>(u.joint)),
                           motion.ddq.col(static_cast<Index>(u.joint)),
                           robot_[l]->structural().col(static_cast<Index>(u.joint)), log.step_s};
        VectorXd sum = VectorXd::Zero(log.samples());
        for (const EffectFit& fit : model.joints[u.joint].effects) {
          const EffectInfo& info = *find_effect(fit.effect);
          if (!info.uses_sign || info.needs_total || info.needs_peers || info.acts_on != ActsOn::torque) continue;
          const VectorXd theta = Eigen::Map<const VectorXd>(fit.linear.data(), static_cast<Index>(fit.linear.size()));
          sum += (effect_columns(fit.effect, fit.shape, wide.joints[u.joint].sign_width, series) -
                  effect_columns(fit.effect, fit.shape, narrow.joints[u.joint].sign_width, series)) *
                 theta / (2 * difference);
        }
        columns[u.joint] = follow(l, u.joint, sum);
      } else {
        const EffectFit& fit = fit_of(model, u);
        const EffectInfo& info = *find_effect(fit.effect);
        if (by_difference(info) || u.kind == Unknown::Kind::rotor) {
          // One-sided: half the work. Away from the bound of a shape.
          IdentifiedModel more = model;
          double value = u.kind == Unknown::Kind::shape ? 1.0 : std::max(std::fabs(u.value), 1e-6);
          if (u.kind == Unknown::Kind::rotor) value = std::max(value, u.prior_std);
          double step = difference * value;
          if (u.kind == Unknown::Kind::shape && fit.shape[u.index] * std::exp(step) > u.upper) step = -step;
          add_to(more, u, step);
          if (info.acts_on == ActsOn::torque && u.kind != Unknown::Kind::rotor && !bends_slowly) {
            columns[u.joint] = robot_[l]->own_slope(more, u.joint, step);
          } else {
            const MatrixXd slope = (torque_of(l, more) - torque) / step;
            for (std::size_t j = 0; j < n; ++j) columns[j] = slope.col(static_cast<Index>(j));
          }
        } else if (u.kind == Unknown::Kind::linear) {
          columns[u.joint] =
              full_rate(l, {fit.effect, u.joint, fit.shape}).joints[u.joint].col(static_cast<Index>(u.index));
        } else {
          EffectCandidate more{fit.effect, u.joint, fit.shape}, less = more;
          more.shape[u.index] *= 1 + difference;
          less.shape[u.index] *= 1 - difference;
          const VectorXd theta = Eigen::Map<const VectorXd>(fit.linear.data(), static_cast<Index>(fit.linear.size()));
          columns[u.joint] =
              (full_rate(l, more).joints[u.joint] - full_rate(l, less).joints[u.joint]) * theta / (2 * difference);
        }
        if (drifts(fit.effect) && u.kind == Unknown::Kind::linear) {
          // predict() starts cold
          const VectorXd cold = robot_[l]->phi({fit.effect, u.joint, fit.shape}).col(static_cast<Index>(u.index));
          predicted.col(static_cast<Index>(u.joint)) += u.value * (columns[u.joint] - cold);
        }
      }
      for (std::size_t j = 0; j < n; ++j) {
        const Index local = rows_[j].local[static_cast<std::size_t>(c)];
        if (local >= 0 && columns[j].size() > 0) full[j].col(local - (nb - first_base(j))) = columns[j];
      }
    }
    const double lead = model.filter.torque_lead_s / log.step_s;
    for (std::size_t j = 0; j < n; ++j) {
      const auto k = static_cast<Index>(j);
      full[j].rightCols(1) = predicted.col(k);
      const MatrixXd kept = log.decimate(log.filter_columns(full[j]));
      rows_[j].x.block(at, nb - first_base(j), count, kept.cols() - 1) = kept.leftCols(kept.cols() - 1);
      MatrixXd tau = log.filter_columns(log.tau.col(k));
      if (lead != 0) tau = at_other_times(tau, -lead);
      rows_[j].y.segment(at, count) = log.decimate(tau) - kept.rightCols(1);
    }
  });
  // y = r + J x0
  VectorXd x0(columns_);
  for (Index c = 0; c < columns_; ++c) {
    const Unknown& u = unknowns_[static_cast<std::size_t>(c)];
    x0[c] = u.kind == Unknown::Kind::shape || u.kind == Unknown::Kind::width ? 0 : u.value;
  }
  std::vector<Index> all;
  for (Index c = 0; c < columns_; ++c) all.push_back(c);
  parallel_for(n, [&](std::size_t j) {
    JointRows& rows = rows_[j];
    for (std::size_t i = 0; i < rows.column.size(); ++i)
      rows.y += rows.x.col(static_cast<Index>(i)) * x0[rows.column[i]];
    sum_up(rows, 0);
  });
  const auto reweight = [&] {
    for (int round = 0; round < 2; ++round) {
      const LinearFit fit = solve(all);
      weights_ = (fit.rows.array() / fit.square.array().max(1e-18 * fit.rows.array())).matrix();
      for (std::size_t j = 0; j < n; ++j) {
        double square = 0;
        for (const std::size_t b : fit_blocks_) square += rows_[j].sums[b].square;
        // noise-free: no more than 1e-9 of the signal
        weights_[static_cast<Index>(j)] =
            fit.rows[static_cast<Index>(j)] / std::max(fit.square[static_cast<Index>(j)], 1e-18 * square + 1e-300);
      }
    }
    return solve(all);
  };
  const LinearFit fit = reweight();
  // What counts for how much comes before the noise's colour: rows near standstill may be far off.
  row_scale_.resize(n);
  std::vector<VectorXd> coefficients(n), doubts(n);
  parallel_for(n, [&](std::size_t j) {
    const VectorXd e = residual(j, fit);
    // The median: what sticks may be far off without being noise.
    std::vector<double> magnitude;
    for (const std::size_t b : fit_blocks_) {
      for (Index i = 0; i < blocks_[b].count; ++i) magnitude.push_back(std::fabs(e[blocks_[b].first + i]));
    }
    std::nth_element(magnitude.begin(), magnitude.begin() + static_cast<std::ptrdiff_t>(magnitude.size() / 2),
                     magnitude.end());
    const double sigma =
        std::max(1.4826 * magnitude[magnitude.size() / 2], 1e-12 / std::sqrt(weights_[static_cast<Index>(j)]));
    doubts[j].resize(total);
    std::vector<VectorXd> parts;
    for (std::size_t l = 0; l < logs_->size(); ++l) {
      const Block& b = log_rows_[l];
      const VectorXd u = doubt(l, j, sigma);
      doubts[j].segment(b.first, b.count) = u;
      const bool use = models_.has_baseline ? b.healthy : b.fits;
      if (use) parts.emplace_back((e.segment(b.first, b.count).array() / (1 + u.array()).sqrt()).matrix());
    }
    coefficients[j] = autoregression(parts);
  });
  if (whitening_.empty()) whitening_ = std::move(coefficients);
  parallel_for(n, [&](std::size_t j) {
    JointRows& rows = rows_[j];
    // A whitened row is as doubtful as those that it is made of.
    VectorXd sum = doubts[j];
    for (const Block& b : log_rows_) {
      for (Index lag = 1; lag <= whitening_[j].size() && lag < b.count; ++lag)
        sum.segment(b.first + lag, b.count - lag) +=
            whitening_[j][lag - 1] * whitening_[j][lag - 1] * doubts[j].segment(b.first, b.count - lag);
    }
    row_scale_[j] = (1 + sum.array()).sqrt().inverse();
    for (const Block& b : log_rows_) {
      rows.x.middleRows(b.first, b.count) = whiten(j, rows.x.middleRows(b.first, b.count));
      rows.y.segment(b.first, b.count) = whiten(j, rows.y.segment(b.first, b.count));
    }
    rows.x = row_scale_[j].asDiagonal() * rows.x;
    rows.y = row_scale_[j].cwiseProduct(rows.y);
    rows.sums.clear();
    sum_up(rows, 0);
  });
  parallel_for(models_.background.size(), [&](std::size_t k) { add_background(models_.background[k]); });
  reweight();
}

/// What a healthy joint has that no effect explains.
void Linearised::add_background(std::size_t joint) {
  auto background = std::make_unique<Background>();
  background->b = features(*this, joint, true);
  MatrixXd& b = background->b;
  b.conservativeResize(Eigen::NoChange, b.cols() - time_features);
  // Of the size of the noise each at most: friction and base parameters must not hide in it.
  const VectorXd rms = (b.colwise().norm() / std::sqrt(static_cast<double>(b.rows()))).transpose().array().max(1e-300);
  b = b * rms.cwiseInverse().asDiagonal();
  MatrixXd gram = MatrixXd::Identity(b.cols(), b.cols()) * Background::prior;
  for (const std::size_t i : fit_blocks_) {
    const auto rows = b.middleRows(blocks_[i].first, blocks_[i].count);
    gram.noalias() += rows.transpose() * rows;
  }
  background->inverse = SymmetricSolver(gram).inverse();
  background_[joint] = std::move(background);
  JointRows& rows = rows_[joint];
  const Index total = rows.x.rows();
  const MatrixXd x = without_background(joint, rows.x), y = without_background(joint, rows.y);
  rows.x = x.topRows(total);
  rows.y = y.topRows(total);
  rows.more_x = x.bottomRows(x.rows() - total);
  rows.more_y = y.bottomRows(y.rows() - total);
  rows.sums.clear();
  sum_up(rows, 0);
}

MatrixXd Linearised::without_background(std::size_t joint, const MatrixXd& x) const {
  if (!background_[joint]) return x;
  const Background& background = *background_[joint];
  MatrixXd products = MatrixXd::Zero(background.b.cols(), x.cols());
  for (const std::size_t i : fit_blocks_) {
    const Block& block = blocks_[i];
    products.noalias() +=
        background.b.middleRows(block.first, block.count).transpose() * x.middleRows(block.first, block.count);
  }
  const MatrixXd c = background.inverse * products;
  MatrixXd out(x.rows() + c.rows(), x.cols());
  out.topRows(x.rows()) = x - background.b * c;
  out.bottomRows(c.rows()) = -std::sqrt(Background::prior) * c;
  return out;
}

void Linearised::sum_up(JointRows& rows, Index from) const {
  const Index cols = rows.x.cols(), more = cols - from;
  const auto add = [&](JointRows::Sums& s, const Eigen::Ref<const MatrixXd>& x, const Eigen::Ref<const VectorXd>& y) {
    s.gram.conservativeResize(cols, cols);
    const auto fresh = x.rightCols(more);
    s.gram.topRightCorner(from, more).noalias() = x.leftCols(from).transpose() * fresh;
    s.gram.bottomLeftCorner(more, from) = s.gram.topRightCorner(from, more).transpose();
    MatrixXd own = MatrixXd::Zero(more, more);
    own.selfadjointView<Eigen::Lower>().rankUpdate(fresh.transpose());
    s.gram.bottomRightCorner(more, more) = own.selfadjointView<Eigen::Lower>();
    s.projection.conservativeResize(cols);
    s.projection.tail(more) = fresh.transpose() * y;
    s.square = y.squaredNorm();
    s.rows = static_cast<double>(y.size());
  };
  rows.sums.resize(blocks_.size());
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    const Block& block = blocks_[b];
    add(rows.sums[b], rows.x.middleRows(block.first, block.count), rows.y.segment(block.first, block.count));
  }
  if (rows.more_y.size() > 0) add(rows.more, rows.more_x, rows.more_y);
}

/// Columns around a model in which some of a joint's inertia is its rotor's: the same torque, but another load on the
/// gear. What bends is of the motion that is not noise.
std::shared_ptr<const RobotColumns> Linearised::columns_for(std::size_t log, const Group& group) const {
  const bool rotor = group.rotor && group.rotor_inertia != 0, slow = slow_[log] && bends(group.candidate.effect);
  if (!rotor && !slow) return robot_[log];
  const std::tuple key(log, rotor ? group.candidate.joint : 0, rotor ? group.rotor_inertia : 0.0, slow);
  {
    const std::lock_guard lock(for_group_mutex_);
    if (const auto at = for_group_.find(key); at != for_group_.end()) return at->second;
  }
  IdentifiedModel model = models_.current;
  if (rotor) {
    EffectFit fit;
    fit.effect = RotorInertia::name;
    fit.linear = {group.rotor_inertia};
    model.joints[group.candidate.joint].effects.push_back(std::move(fit));
    take_from_base(model, group.rotor->in_base, group.rotor_inertia);
  }
  auto made = std::make_shared<const RobotColumns>(with_load_of((*logs_)[log].log, std::move(model)),
                                                   slow ? *slow_[log] : *motions_[log]);
  const std::lock_guard lock(for_group_mutex_);
  return for_group_.emplace(key, std::move(made)).first->second;
}

/// What a model says of a log's motion; its gears bend by what is not noise.
MatrixXd Linearised::torque_of(std::size_t log, IdentifiedModel model) const {
  const auto torque = [&](const IdentifiedModel& m, const Motion& motion) {
    return fxdyn::predict(m, motion.q, motion.dq, motion.ddq, motion.step_s);
  };
  model = with_load_of((*logs_)[log].log, std::move(model));
  const auto stiff = slow_[log] ? stiffened(model) : std::nullopt;
  if (!stiff) return torque(model, *motions_[log]);
  return torque(*stiff, *motions_[log]) + torque(model, *slow_[log]) - torque(*stiff, *slow_[log]);
}

std::vector<MatrixXd> Linearised::make(const Group& group) const {
  std::vector<MatrixXd> out(joints());
  const Index total = log_rows_.back().first + log_rows_.back().count;
  for (std::size_t l = 0; l < logs_->size(); ++l) {
    if ((*logs_)[l].healthy) continue;
    const EffectColumns full = full_rate(l, group.candidate, *columns_for(l, group));
    for (std::size_t j = 0; j < joints(); ++j) {
      if (full.joints[j].size() == 0) continue;
      if (out[j].size() == 0) out[j].setZero(total, full.joints[j].cols());
      out[j].middleRows(log_rows_[l].first, log_rows_[l].count) = prepare(l, j, full.joints[j]);
    }
  }
  for (std::size_t j = 0; j < joints(); ++j) {
    if (out[j].size() > 0) out[j] = without_background(j, out[j]);
  }
  return out;
}

std::size_t Linearised::add(const Group& group, const std::vector<MatrixXd>& columns) {
  Group g = group;
  g.first = columns_;
  g.count = 0;
  for (const MatrixXd& c : columns) g.count = std::max(g.count, c.cols());
  columns_ += g.count;
  parallel_for(joints(), [&](std::size_t j) {
    JointRows& rows = rows_[j];
    rows.local.resize(static_cast<std::size_t>(columns_), -1);
    if (columns[j].size() == 0) return;
    const Index from = rows.x.cols();
    rows.x.conservativeResize(Eigen::NoChange, from + g.count);
    rows.x.rightCols(g.count) = columns[j].topRows(rows.x.rows());
    rows.more_x.conservativeResize(rows.more_y.size(), from + g.count);
    rows.more_x.rightCols(g.count) = columns[j].bottomRows(rows.more_y.size());
    for (Index i = 0; i < g.count; ++i) {
      rows.local[static_cast<std::size_t>(g.first + i)] = from + i;
      rows.column.push_back(g.first + i);
    }
    sum_up(rows, from);
  });
  groups_.push_back(std::move(g));
  return groups_.size() - 1;
}

void Linearised::add_all(std::vector<Group> groups) {
  if (groups.empty()) return;
  std::vector<std::vector<MatrixXd>> made(groups.size());
  parallel_for(groups.size(), [&](std::size_t g) { made[g] = make(groups[g]); });
  std::vector<Index> from(joints());
  for (std::size_t j = 0; j < joints(); ++j) from[j] = rows_[j].x.cols();
  for (std::size_t g = 0; g < groups.size(); ++g) {
    groups[g].first = columns_;
    groups[g].count = 0;
    for (const MatrixXd& c : made[g]) groups[g].count = std::max(groups[g].count, c.cols());
    columns_ += groups[g].count;
  }
  parallel_for(joints(), [&](std::size_t j) {
    JointRows& rows = rows_[j];
    rows.local.resize(static_cast<std::size_t>(columns_), -1);
    Index at = from[j];
    for (std::size_t g = 0; g < groups.size(); ++g) {
      if (made[g][j].size() == 0) continue;
      for (Index i = 0; i < groups[g].count; ++i) {
        rows.local[static_cast<std::size_t>(groups[g].first + i)] = at++;
        rows.column.push_back(groups[g].first + i);
      }
    }
    rows.x.conservativeResize(Eigen::NoChange, at);
    rows.more_x.conservativeResize(rows.more_y.size(), at);
    for (std::size_t g = 0; g < groups.size(); ++g) {
      if (made[g][j].size() == 0) continue;
      const Index place = rows.local[static_cast<std::size_t>(groups[g].first)];
      rows.x.middleCols(place, groups[g].count) = made[g][j].topRows(rows.x.rows());
      rows.more_x.middleCols(place, groups[g].count) = made[g][j].bottomRows(rows.more_y.size());
    }
    sum_up(rows, from[j]);
  });
  groups_.insert(groups_.end(), groups.begin(), groups.end());
}

void Linearised::normal(const std::vector<Index>& columns, const std::vector<std::size_t>& blocks, MatrixXd& gram,
                        VectorXd& projection) const {
  const auto p = static_cast<Index>(columns.size());
  gram.setZero(p, p);
  projection.setZero(p);
  for (std::size_t j = 0; j < joints(); ++j) {
    const JointRows& rows = rows_[j];
    std::vector<Index> place, local;
    for (Index i = 0; i < p; ++i) {
      const Index at = rows.local[static_cast<std::size_t>(columns[static_cast<std::size_t>(i)])];
      if (at < 0) continue;
      place.push_back(i);
      local.push_back(at);
    }
    const double w = weights_[static_cast<Index>(j)];
    for (const std::size_t b : blocks) {
      gram(place, place) += w * rows.sums[b].gram(local, local);
      projection(place) += w * rows.sums[b].projection(local);
    }
    if (rows.more_y.size() == 0) continue;
    gram(place, place) += w * rows.more.gram(local, local);
    projection(place) += w * rows.more.projection(local);
  }
  for (Index i = 0; i < p; ++i) {
    const auto c = static_cast<std::size_t>(columns[static_cast<std::size_t>(i)]);
    if (c >= unknowns_.size() || unknowns_[c].prior_std == 0) continue;
    const double information = 1 / (unknowns_[c].prior_std * unknowns_[c].prior_std);
    gram(i, i) += information;
    projection[i] += information * unknowns_[c].prior;
  }
}

LinearFit Linearised::solve(const std::vector<Index>& columns, const std::vector<std::size_t>& blocks) const {
  LinearFit fit;
  fit.columns = columns;
  VectorXd projection;
  normal(columns, blocks, fit.information, projection);
  fit.x = SymmetricSolver(fit.information).solve(projection);
  fit.square = square(fit, blocks);
  fit.rows = row_count(blocks);
  return fit;
}

VectorXd Linearised::row_count(const std::vector<std::size_t>& blocks) const {
  VectorXd out = VectorXd::Zero(static_cast<Index>(joints()));
  for (std::size_t j = 0; j < joints(); ++j) {
    for (const std::size_t b : blocks) out[static_cast<Index>(j)] += rows_[j].sums[b].rows;
  }
  return out;
}

VectorXd Linearised::square(const LinearFit& fit, const std::vector<std::size_t>& blocks) const {
  VectorXd out = VectorXd::Zero(static_cast<Index>(joints()));
  for (std::size_t j = 0; j < joints(); ++j) {
    const VectorXd e = residual(j, fit);
    for (const std::size_t b : blocks)
      out[static_cast<Index>(j)] += e.segment(blocks_[b].first, blocks_[b].count).squaredNorm();
  }
  return out;
}

VectorXd Linearised::residual(std::size_t joint, const LinearFit& fit) const {
  const JointRows& rows = rows_[joint];
  VectorXd e = rows.y;
  for (std::size_t i = 0; i < fit.columns.size(); ++i) {
    const Index at = rows.local[static_cast<std::size_t>(fit.columns[i])];
    if (at >= 0) e -= fit.x[static_cast<Index>(i)] * rows.x.col(at);
  }
  return e;
}

VectorXd Linearised::residual_with_background(std::size_t joint, const LinearFit& fit) const {
  VectorXd e = residual(joint, fit);
  if (!background_[joint]) return e;
  const JointRows& rows = rows_[joint];
  VectorXd more = rows.more_y;
  for (std::size_t i = 0; i < fit.columns.size(); ++i) {
    const Index at = rows.local[static_cast<std::size_t>(fit.columns[i])];
    if (at >= 0) more -= fit.x[static_cast<Index>(i)] * rows.more_x.col(at);
  }
  return e - background_[joint]->b * (more / std::sqrt(Background::prior));
}

MatrixXd Linearised::cross(const std::vector<Index>& columns, Index from) const {
  MatrixXd out = MatrixXd::Zero(static_cast<Index>(columns.size()), columns_ - from);
  for (std::size_t j = 0; j < joints(); ++j) {
    const JointRows& rows = rows_[j];
    std::vector<Index> place, local, there, theirs;
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const Index at = rows.local[static_cast<std::size_t>(columns[i])];
      if (at < 0) continue;
      place.push_back(static_cast<Index>(i));
      local.push_back(at);
    }
    for (Index c = from; c < columns_; ++c) {
      const Index at = rows.local[static_cast<std::size_t>(c)];
      if (at < 0) continue;
      there.push_back(c - from);
      theirs.push_back(at);
    }
    const double w = weights_[static_cast<Index>(j)];
    for (const std::size_t b : fit_blocks_) out(place, there) += w * rows.sums[b].gram(local, theirs);
    if (rows.more_y.size() > 0) out(place, there) += w * rows.more.gram(local, theirs);
  }
  return out;
}

VectorXd Linearised::projection(Index from) const {
  VectorXd out = VectorXd::Zero(columns_ - from);
  for (std::size_t j = 0; j < joints(); ++j) {
    const JointRows& rows = rows_[j];
    for (std::size_t i = 0; i < rows.column.size(); ++i) {
      const Index c = rows.column[i];
      if (c < from) continue;
      const auto local = static_cast<Index>(i);
      double sum = rows.more_y.size() > 0 ? rows.more.projection[local] : 0;
      for (const std::size_t b : fit_blocks_) sum += rows.sums[b].projection[local];
      out[c - from] += weights_[static_cast<Index>(j)] * sum;
    }
  }
  return out;
}

MatrixXd Linearised::gram(Index first, Index count) const {
  MatrixXd out = MatrixXd::Zero(count, count);
  for (std::size_t j = 0; j < joints(); ++j) {
    const JointRows& rows = rows_[j];
    const Index at = rows.local[static_cast<std::size_t>(first)];
    if (at < 0) continue;
    for (const std::size_t b : fit_blocks_)
      out += weights_[static_cast<Index>(j)] * rows.sums[b].gram.block(at, at, count, count);
    if (rows.more_y.size() > 0) out += weights_[static_cast<Index>(j)] * rows.more.gram.block(at, at, count, count);
  }
  return out;
}

void add_to_base(IdentifiedModel& model, std::size_t parameter, double step) {
  BaseParameter& base = model.base[parameter];
  base.value += step;
  LinkInertia<Real>& link = model.inertia[base.column / parameters_per_link];
  auto values = to_array(link);
  values[base.column % parameters_per_link] += step;
  link = to_inertia(values);
}

BaseSet base_of(const IdentifiedModel& model) {
  BaseSet base;
  for (const BaseParameter& parameter : model.base) base.columns.push_back(static_cast<Index>(parameter.column));
  return base;
}

bool tells_rotor(std::string_view effect) { return find_effect(effect)->separates_rotor(); }

void take_from_base(IdentifiedModel& model, const VectorXd& rotor_in_base, double inertia) {
  for (std::size_t k = 0; k < model.base.size(); ++k)
    add_to_base(model, k, -inertia * rotor_in_base[static_cast<Index>(k)]);
}

double least_inertia(const IdentifiedModel& model, std::size_t joint, const std::vector<const MatrixXd*>& logs) {
  constexpr Index poses = 200;
  const auto n = static_cast<Index>(model.joints.size());
  const auto j = static_cast<Index>(joint);
  Regressor regressor(to_dh(model.robot));
  VectorXd values = VectorXd::Zero(n * static_cast<Index>(parameters_per_link));
  for (const BaseParameter& parameter : model.base) values[static_cast<Index>(parameter.column)] = parameter.value;
  const VectorXd still = VectorXd::Zero(n), unit = VectorXd::Unit(n, j);
  double least = 1e300;
  for (const MatrixXd* q : logs) {
    for (Index k = 0; k < q->rows(); k += std::max<Index>(1, q->rows() / poses)) {
      const double with = regressor(q->row(k), still, unit).row(j) * values;
      least = std::min(least, with - regressor(q->row(k), still, still).row(j) * values);
    }
  }
  return least < 1e300 ? std::max(0.0, least) : 0;
}

MatrixXd base_covariance(const Linearised& at) {
  const auto n = static_cast<Index>(at.models().current.base.size());
  std::vector<Index> all(at.unknowns().size());
  std::iota(all.begin(), all.end(), Index{0});
  return SymmetricSolver(at.solve(all).information).inverse().topLeftCorner(n, n);
}

void update(Models& models, const Linearised& at, const LinearFit& fit, double share) {
  for (std::size_t i = 0; i < fit.columns.size(); ++i) {
    const auto c = static_cast<std::size_t>(fit.columns[i]);
    if (c >= at.unknowns().size()) continue;
    const Unknown& u = at.unknowns()[c];
    const bool logarithm = u.kind == Unknown::Kind::shape || u.kind == Unknown::Kind::width;
    double step = share * (fit.x[static_cast<Index>(i)] - u.value);
    if (logarithm) step = std::clamp(step, -0.4, 0.4);
    // Payload's mass first: its centre is first moment over mass.
    if (!u.change && u.kind == Unknown::Kind::linear && u.body && u.index == 0 &&
        fit_of(models.current, u).effect == Payload::name) {
      EffectFit& load = models.current.body[u.effect];
      const double mass = std::max(least_mass, load.linear[0] + step);
      for (std::size_t k = 1; k < load.linear.size(); ++k) load.linear[k] *= load.linear[0] / mass;
      load.linear[0] = mass;
      continue;
    }
    add_to(models.current, u, step);
    const bool named =
        u.kind != Unknown::Kind::base && u.kind != Unknown::Kind::width && fit_of(models.current, u).named;
    if (models.has_baseline && !u.change && !named) add_to(models.healthy, in_healthy(u), step);
  }
}

}  // namespace fxdyn::diagnosis
