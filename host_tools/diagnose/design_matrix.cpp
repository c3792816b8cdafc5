#include "host_tools/diagnose/design_matrix.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/diagnose/models.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Relative step of differences.
constexpr double difference = 1e-3;

/// Columns that come from differences of predict() rather than from phi.
bool by_difference(const EffectInfo& info) {
  return info.acts_on != ActsOn::torque || info.needs_total || info.needs_structural;
}

VectorXd coefficients(const EffectFit& fit) {
  return Eigen::Map<const VectorXd>(fit.linear.data(), static_cast<Index>(fit.linear.size()));
}

/// d torque / d unknown over one log, at full rate, around the model of its session.
class Derivatives {
 public:
  Derivatives(const LogColumns& columns, std::size_t log)
      : columns_(columns),
        log_(log),
        model_(columns.model(log)),
        bends_slowly_(columns.bends_slowly(log)),
        torque_(bends_slowly_ ? columns.torque_of(log, model_) : columns.robot(log).torque()) {}

  const MatrixXd& torque() const { return torque_; }

  /// By joint; empty: it feels nothing.
  std::vector<MatrixXd> operator()(const Unknown& u) const {
    std::vector<MatrixXd> out(columns_.joints());
    if (u.kind == Unknown::Kind::width) {
      out[u.joint] = columns_.follow(log_, u.joint, of_width(u.joint));
      return out;
    }
    const EffectFit& fit = effect_of(model_, u);
    if (by_difference(*find_effect(fit.effect)) || u.kind == Unknown::Kind::rotor) {
      of_difference(u, out);
    } else if (u.kind == Unknown::Kind::linear) {
      const EffectColumns phi = columns_.of(log_, EffectCandidate{fit.effect, u.joint, fit.shape});
      out[u.joint] = phi.joints[u.joint].col(static_cast<Index>(u.index));
    } else {
      out[u.joint] = of_shape(u, fit);
    }
    return out;
  }

  /// phi of friction that drifts, for a log that begins cold as predict() has it, less that for one as warm as the
  /// robot was.
  VectorXd warm_less_cold(const Unknown& u, const MatrixXd& warm) const {
    const EffectFit& fit = effect_of(model_, u);
    const VectorXd cold = columns_.robot(log_).phi({fit.effect, u.joint, fit.shape}).col(static_cast<Index>(u.index));
    return warm - cold;
  }
  bool drifts(const Unknown& u) const {
    return u.kind == Unknown::Kind::linear && fxdyn::drifts(effect_of(model_, u).effect);
  }

 private:
  /// d / d ln(width) of everything that uses the sign.
  VectorXd of_width(std::size_t joint) const {
    const Motion& motion = columns_.motion(log_);
    const auto j = static_cast<Index>(joint);
    const double width = joints_of(model_)[joint].sign_width;
    const double wide = width * (1 + difference), narrow = width * (1 - difference);
    const JointSeries series{motion.q.col(j), motion.dq.col(j), motion.ddq.col(j),
                             columns_.robot(log_).structural().col(j), motion.step_s};
    VectorXd sum = VectorXd::Zero(motion.q.rows());
    for (const EffectFit& fit : joints_of(model_)[joint].effects) {
      const EffectInfo& info = *find_effect(fit.effect);
      if (!info.uses_sign || info.needs_total || info.needs_peers || info.acts_on != ActsOn::torque) continue;
      const VectorXd theta = coefficients(fit);
      sum += (effect_columns(fit.effect, fit.shape, wide, series) -
              effect_columns(fit.effect, fit.shape, narrow, series)) *
             theta / (2 * difference);
    }
    return sum;
  }

  VectorXd of_shape(const Unknown& u, const EffectFit& fit) const {
    EffectCandidate more{fit.effect, u.joint, fit.shape}, less = more;
    more.shape[u.index] *= 1 + difference;
    less.shape[u.index] *= 1 - difference;
    const VectorXd theta = coefficients(fit);
    return (columns_.of(log_, more).joints[u.joint] - columns_.of(log_, less).joints[u.joint]) * theta /
           (2 * difference);
  }

  /// One-sided: half the work. Away from the bound of a shape.
  void of_difference(const Unknown& u, std::vector<MatrixXd>& out) const {
    const EffectFit& fit = effect_of(model_, u);
    ModelValue more = model_;
    double value = u.kind == Unknown::Kind::shape ? 1.0 : std::max(std::fabs(u.value), 1e-6);
    if (u.kind == Unknown::Kind::rotor) value = std::max(value, u.prior_std);
    double step = difference * value;
    const bool leaves = u.kind == Unknown::Kind::shape ? fit.shape[u.index] * std::exp(step) > u.upper
                                                       : u.kind == Unknown::Kind::rotor && u.value + step > u.upper;
    if (leaves) step = -step;
    add_to(more, u, step);
    if (find_effect(fit.effect)->acts_on == ActsOn::torque && u.kind != Unknown::Kind::rotor && !bends_slowly_) {
      out[u.joint] = columns_.robot(log_).own_slope(more, u.joint, step);
      return;
    }
    const MatrixXd slope = (columns_.torque_of(log_, more) - torque_) / step;
    for (std::size_t j = 0; j < out.size(); ++j) out[j] = slope.col(static_cast<Index>(j));
  }

  const LogColumns& columns_;
  std::size_t log_;
  const IdentifiedModel& model_;
  bool bends_slowly_;  ///< then predict() is not all there is
  MatrixXd torque_;
};

/// Columns that a joint feels: its base parameters, its own unknowns, and whatever is not an effect on its torque.
std::vector<Index> felt_columns(const LogColumns& columns, const std::vector<Unknown>& unknowns, std::size_t joint) {
  const Index nb = columns.base_parameters();
  std::vector<Index> out;
  for (Index c = columns.first_base(joint); c < nb; ++c) out.push_back(c);
  for (Index c = nb; c < static_cast<Index>(unknowns.size()); ++c) {
    const Unknown& u = unknowns[static_cast<std::size_t>(c)];
    bool felt = u.joint == joint && !u.body;
    if (u.kind != Unknown::Kind::width) {
      const EffectInfo& info = *find_effect(effect_of(columns.models().current, u).effect);
      felt |= u.body || info.acts_on != ActsOn::torque || u.kind == Unknown::Kind::rotor;
    }
    if (felt) out.push_back(c);
  }
  return out;
}

/// Filters and decimates columns as they are made, as many at once as the filter takes side by side: all of them at
/// full rate are several times the log.
class Keeper {
 public:
  explicit Keeper(const ProcessedLog& log) : log_(log), pending_(log.samples(), 8) {}

  /// @param to where the rows go
  void add(const Eigen::Ref<const VectorXd>& column, double* to) {
    pending_.col(static_cast<Index>(to_.size())) = column;
    to_.push_back(to);
    if (static_cast<Index>(to_.size()) == pending_.cols()) flush();
  }
  void flush() {
    if (to_.empty()) return;
    const MatrixXd kept = log_.decimate(log_.filter_columns(pending_.leftCols(static_cast<Index>(to_.size()))));
    for (std::size_t i = 0; i < to_.size(); ++i)
      Eigen::Map<VectorXd>(to_[i], kept.rows()) = kept.col(static_cast<Index>(i));
    to_.clear();
  }

 private:
  const ProcessedLog& log_;
  MatrixXd pending_;
  std::vector<double*> to_;
};

/// Rows of all joints, as they are filled log by log.
class RowsOfJoints {
 public:
  RowsOfJoints(const LogColumns& columns, const std::vector<Unknown>& unknowns, const Blocks& blocks)
      : columns_(columns), unknowns_(unknowns), blocks_(blocks), rows_(columns.joints()) {
    for (std::size_t j = 0; j < rows_.size(); ++j) {
      rows_[j].column = felt_columns(columns, unknowns, j);
      rows_[j].local.assign(unknowns.size(), -1);
      for (std::size_t i = 0; i < rows_[j].column.size(); ++i)
        rows_[j].local[static_cast<std::size_t>(rows_[j].column[i])] = static_cast<Index>(i);
      rows_[j].x.setZero(blocks.rows(), static_cast<Index>(rows_[j].column.size()));
      rows_[j].y.setZero(blocks.rows());
    }
  }

  void fill(std::size_t log) {
    const std::size_t n = rows_.size();
    const Derivatives derivatives(columns_, log);
    Keeper keeper(columns_.logs()[log].log);
    const Block& b = blocks_.of_log[log];
    MatrixXd predicted = derivatives.torque();
    for (Index c = columns_.base_parameters(); c < static_cast<Index>(unknowns_.size()); ++c) {
      const Unknown& u = unknowns_[static_cast<std::size_t>(c)];
      if (columns_.logs()[log].healthy && is_of_today(u)) continue;
      const Unknown here = columns_.logs()[log].healthy ? in_healthy(u) : u;
      const std::vector<MatrixXd> made = derivatives(here);
      if (derivatives.drifts(here))
        predicted.col(static_cast<Index>(u.joint)) += u.value * derivatives.warm_less_cold(here, made[u.joint]);
      for (std::size_t j = 0; j < n; ++j) {
        const Index local = rows_[j].place(c);
        if (local >= 0 && made[j].size() > 0) keeper.add(made[j].col(0), &rows_[j].x(b.first, local));
      }
    }
    for (std::size_t j = 0; j < n; ++j) keeper.add(predicted.col(static_cast<Index>(j)), &rows_[j].y[b.first]);
    keeper.flush();
    for (std::size_t j = 0; j < n; ++j) keep(log, j);
  }

  /// y = r + J x0
  std::vector<JointRows> finish() {
    parallel_for(rows_.size(), [&](std::size_t j) {
      JointRows& rows = rows_[j];
      for (std::size_t i = 0; i < rows.column.size(); ++i) {
        const Unknown& u = unknowns_[static_cast<std::size_t>(rows.column[i])];
        rows.y += rows.x.col(static_cast<Index>(i)) * (u.is_logarithm() ? 0 : u.value);
      }
    });
    return std::move(rows_);
  }

 private:
  Index base_columns(std::size_t joint) const { return columns_.base_parameters() - columns_.first_base(joint); }

  bool is_of_today(const Unknown& u) const {
    return u.change || (u.kind != Unknown::Kind::width && effect_of(columns_.models().current, u).named);
  }

  /// The base columns, and the measured torque less the prediction that y holds.
  void keep(std::size_t log, std::size_t joint) {
    const ProcessedLog& l = columns_.logs()[log].log;
    const Block& b = blocks_.of_log[log];
    JointRows& rows = rows_[joint];
    rows.x.block(b.first, 0, b.count, base_columns(joint)) = columns_.base_rows(log, joint);
    MatrixXd tau = l.filter_columns(l.tau.col(static_cast<Index>(joint)));
    if (const double lead = filter_of(columns_.model(log)).torque_lead_s / l.step_s; lead != 0)
      tau = at_other_times(tau, -lead);
    auto y = rows.y.segment(b.first, b.count);
    y = l.decimate(tau) - y;
  }

  const LogColumns& columns_;
  const std::vector<Unknown>& unknowns_;
  const Blocks& blocks_;
  std::vector<JointRows> rows_;
};

}  // namespace

std::vector<JointRows> design_matrix(const LogColumns& columns, const std::vector<Unknown>& unknowns,
                                     const Blocks& blocks) {
  RowsOfJoints rows(columns, unknowns, blocks);
  parallel_for(blocks.of_log.size(), [&](std::size_t l) { rows.fill(l); });
  return rows.finish();
}

}  // namespace fxdyn::diagnosis
