#include "host_tools/diagnose/deflection.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tools/identify/solver.hpp"
#include "host_tools/model/effects.hpp"
#include "host_tools/parallel.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double least_score = 12;
constexpr double least_closure = 0.5;
/// Of the power of all parts.
constexpr double least_part = 0.05;
/// A parameter that differs by less than this share from the healthy session's has not changed.
constexpr double same_share = 0.33;
constexpr Index order = 6;

/// Rows of one joint's logs.
struct Rows {
  std::vector<const ProcessedLog*> logs;
  std::vector<JointSeries> series;
  std::vector<Index> first, count;
  VectorXd delta;
  std::size_t joint = 0;
  double width = 0.01;

  MatrixXd columns(std::string_view effect, const std::vector<double>& shape) const {
    MatrixXd out;
    for (std::size_t l = 0; l < logs.size(); ++l) {
      const MatrixXd full = effect_columns(effect, shape, width, series[l]);
      const MatrixXd part = logs[l]->decimate(logs[l]->filter_columns(full));
      if (l == 0) out.resize(delta.size(), part.cols());
      out.middleRows(first[l], count[l]) = part;
    }
    return out;
  }
  /// One column a log: encoders are mounted anywhere.
  MatrixXd offsets() const {
    MatrixXd out = MatrixXd::Zero(delta.size(), static_cast<Index>(logs.size()));
    for (std::size_t l = 0; l < logs.size(); ++l) out.block(first[l], static_cast<Index>(l), count[l], 1).setOnes();
    return out;
  }
  MatrixXd whiten(const MatrixXd& x, const VectorXd& a) const {
    MatrixXd out = x;
    for (std::size_t l = 0; l < logs.size(); ++l) {
      auto mine = out.middleRows(first[l], count[l]);
      const auto from = x.middleRows(first[l], count[l]);
      for (Index lag = 1; lag <= a.size() && lag < count[l]; ++lag)
        mine.bottomRows(count[l] - lag) -= a[lag - 1] * from.topRows(count[l] - lag);
      mine.topRows(std::min<Index>(a.size(), count[l])).setZero();
    }
    return out;
  }
};

Rows rows_of(const IdentifiedModel& model, const std::vector<const ProcessedLog*>& logs, std::size_t joint) {
  Rows rows;
  rows.joint = joint;
  rows.width = model.joints[joint].sign_width;
  const auto j = static_cast<Index>(joint);
  IdentifiedModel rigid = model;
  for (JointFit& fit : rigid.joints) fit.effects.clear();
  rigid.filter.torque_lead_s = 0;
  Index total = 0;
  for (const ProcessedLog* log : logs) {
    MotionRows m = log->joint_motion(j);
    JointSeries series{m.q, m.dq, m.ddq, predict(rigid, *log).col(j), log->step_s};
    rows.series.push_back(std::move(series));
    rows.logs.push_back(log);
    rows.first.push_back(total);
    rows.count.push_back(log->rows());
    total += log->rows();
  }
  rows.delta.resize(total);
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const MatrixXd delta = logs[l]->filter_columns((logs[l]->q - logs[l]->qlink).col(j));
    rows.delta.segment(rows.first[l], rows.count[l]) = logs[l]->decimate(delta);
  }
  return rows;
}

struct Part {
  std::string effect;
  std::vector<double> shape;
};
struct Set {
  std::vector<Part> parts;
  VectorXd theta;  ///< after the offsets
  VectorXd std;
  double square = 1e300, score = -1e300;
  double noise = 0;  ///< variance of the whitened residual
};

MatrixXd design(const Rows& rows, const std::vector<Part>& parts) {
  MatrixXd x = rows.offsets();
  for (const Part& part : parts) {
    const MatrixXd c = rows.columns(part.effect, part.shape);
    x.conservativeResize(Eigen::NoChange, x.cols() + c.cols());
    x.rightCols(c.cols()) = c;
  }
  return x;
}

VectorXd colour(const Rows& rows, const VectorXd& e) {
  VectorXd r = VectorXd::Zero(order + 1);
  for (std::size_t l = 0; l < rows.logs.size(); ++l) {
    const VectorXd x = e.segment(rows.first[l], rows.count[l]);
    for (Index lag = 0; lag <= order && lag < x.size(); ++lag)
      r[lag] += x.head(x.size() - lag).dot(x.tail(x.size() - lag));
  }
  if (!(r[0] > 0)) return VectorXd::Zero(order);
  MatrixXd toeplitz(order, order);
  for (Index i = 0; i < order; ++i) {
    for (Index k = 0; k < order; ++k) toeplitz(i, k) = r[std::abs(i - k)];
  }
  toeplitz.diagonal() *= 1 + 1e-4;
  return toeplitz.ldlt().solve(r.tail(order));
}

VectorXd residual(const MatrixXd& x, const VectorXd& y) {
  return y - x * SymmetricSolver(x.transpose() * x).solve(x.transpose() * y);
}

/// Fits a set in whitened rows.
void fit(const Rows& rows, const VectorXd& a, Set& set) {
  const MatrixXd x = rows.whiten(design(rows, set.parts), a);
  const VectorXd y = rows.whiten(rows.delta, a);
  const SymmetricSolver solver(x.transpose() * x);
  const VectorXd theta = solver.solve(x.transpose() * y);
  const auto n = static_cast<double>(y.size());
  set.square = (y - x * theta).squaredNorm();
  set.noise = set.square / n;
  const Index own = x.cols() - static_cast<Index>(rows.logs.size());
  set.theta = theta.tail(own);
  set.std = (solver.inverse().diagonal().tail(own) * set.noise).cwiseMax(0).cwiseSqrt();
  double penalty = 0;
  Index at = 0;
  bool possible = true;
  for (const Part& part : set.parts) {
    const EffectInfo& info = *find_effect(part.effect);
    penalty += static_cast<double>(info.linear.size() + info.shape.size()) * std::log(n) +
               2 * std::log(part.shape.empty() ? 1.0 : 4.0);
    for (const ParameterInfo& p : info.linear) possible &= set.theta[at++] >= p.lower;
  }
  set.score = possible ? -n * std::log(std::max(set.square, 1e-300) / n) - penalty : -1e300;
}

Set best_set(const Rows& rows) {
  const double largest = [&] {
    double most = 0;
    for (const JointSeries& s : rows.series) most = std::max(most, s.structural.cwiseAbs().maxCoeff());
    return std::max(most, 1e-6);
  }();
  const std::vector<double> relaxations{0, 1e-3, 3e-3, 8e-3, 2e-2},
      scales{0.01 * largest, 0.025 * largest, 0.06 * largest, 0.15 * largest};
  const std::vector<Part> full{{std::string(Elasticity::name), {1e-3}},
                               {std::string(Backlash::name), {0.03 * largest}},
                               {std::string(Eccentricity::name), {}}};
  // Colour of what no set explains.
  const VectorXd a = colour(rows, residual(design(rows, full), rows.delta));
  Set best;
  fit(rows, a, best);
  for (unsigned mask = 1; mask < 8; ++mask) {
    Set set;
    for (unsigned i = 0; i < 3; ++i) {
      if ((mask >> i & 1U) != 0) set.parts.push_back(full[i]);
    }
    fit(rows, a, set);
    for (int round = 0; round < 2; ++round) {
      for (std::size_t p = 0; p < set.parts.size(); ++p) {
        if (set.parts[p].shape.empty()) continue;
        const bool gap = set.parts[p].effect == Backlash::name;
        std::vector<double> values = gap ? scales : relaxations;
        if (round > 0) {
          const double now = set.parts[p].shape[0];
          values = {0.7 * now, 0.85 * now, 1.18 * now, 1.4 * now};
        }
        for (const double value : values) {
          Set other = set;
          const ParameterInfo& info = find_effect(set.parts[p].effect)->shape[0];
          other.parts[p].shape[0] = std::clamp(value, info.lower, info.upper);
          fit(rows, a, other);
          if (other.score > set.score) set = other;
        }
      }
    }
    if (set.score > best.score + least_score) best = set;
  }
  return best;
}

/// RMS of a part's deflection over the rows.
double size_of(const Rows& rows, const Part& part, const VectorXd& theta) {
  VectorXd d = rows.columns(part.effect, part.shape) * theta;
  d.array() -= d.mean();
  return d.norm() / std::sqrt(static_cast<double>(d.size()));
}

}  // namespace

Deflections find_deflections(const IdentifiedModel& model, const std::vector<ProcessedLog>& now,
                             const std::vector<ProcessedLog>& before, std::vector<DeflectionEffect>& background) {
  const std::size_t n = model.joints.size();
  std::vector<Deflections> found(n);
  std::vector<std::vector<DeflectionEffect>> learned(n);
  parallel_for(n, [&](std::size_t j) {
    const auto with_link = [&](const std::vector<ProcessedLog>& logs, bool all, Role role) {
      std::vector<const ProcessedLog*> out;
      for (const ProcessedLog& log : logs) {
        if (log.qlink.size() > 0 && log.has_link[j] && (all || log.role == role)) out.push_back(&log);
      }
      return out;
    };
    const auto train = with_link(now, false, Role::train), judge = with_link(now, false, Role::validate),
               healthy = with_link(before, true, Role::train);
    if (train.empty()) return;
    const Rows rows = rows_of(model, train, j);
    Set set = best_set(rows);
    // Encoders are so fine that errors of the torque show too: what is a small part of the deflection is no finding.
    for (bool again = true; again && set.parts.size() > 1;) {
      again = false;
      const VectorXd a = colour(rows, residual(design(rows, set.parts), rows.delta));
      double whole = 0;
      std::vector<double> sizes;
      Index at = 0;
      for (const Part& part : set.parts) {
        const auto count = static_cast<Index>(find_effect(part.effect)->linear.size());
        sizes.push_back(std::pow(size_of(rows, part, set.theta.segment(at, count)), 2));
        whole += sizes.back();
        at += count;
      }
      const auto least = std::min_element(sizes.begin(), sizes.end());
      if (*least > least_part * whole) break;
      set.parts.erase(set.parts.begin() + (least - sizes.begin()));
      fit(rows, a, set);
      again = true;
    }
    if (set.parts.empty()) return;
    Set old;
    std::optional<Rows> old_rows;
    if (!healthy.empty()) {
      old_rows = rows_of(model, healthy, j);
      old = best_set(*old_rows);
    }
    const Rows judged = judge.empty() ? rows : rows_of(model, judge, j);
    const VectorXd judged_before = residual(judged.offsets(), judged.delta);
    Index at = 0;
    VectorXd all = VectorXd::Zero(judged.delta.size());
    std::vector<VectorXd> part_of;
    for (const Part& part : set.parts) {
      const auto count = static_cast<Index>(find_effect(part.effect)->linear.size());
      part_of.push_back(judged.columns(part.effect, part.shape) * set.theta.segment(at, count));
      all += part_of.back();
      at += count;
    }
    const VectorXd judged_after = residual(judged.offsets(), judged.delta - all);
    // The noise of the two encoders is no gap.
    const double white =
        std::max(0.0, std::min(judged_after.squaredNorm(), set.noise * static_cast<double>(judged_after.size())));
    const double gap = std::max(judged_before.squaredNorm() - white, 1e-300);
    const double closure = (judged_before.squaredNorm() - judged_after.squaredNorm()) / gap;
    if (closure < least_closure) {
      found[j].notes.push_back(fmt::format("{}: the deflection that the link encoder shows is none that has a name",
                                           model.robot.joints[j].name));
      return;
    }
    at = 0;
    for (std::size_t p = 0; p < set.parts.size(); ++p) {
      const Part& part = set.parts[p];
      const EffectInfo& info = *find_effect(part.effect);
      const auto count = static_cast<Index>(info.linear.size());
      const VectorXd theta = set.theta.segment(at, count), std = set.std.segment(at, count);
      at += count;
      DeflectionEffect effect;
      effect.joint = j;
      effect.fit.effect = part.effect;
      effect.fit.shape = part.shape;
      effect.fit.named = true;
      for (Index i = 0; i < count; ++i) {
        effect.fit.linear.push_back(theta[i]);
        effect.fit.linear_std.push_back(std[i]);
      }
      effect.fit.shape_std.assign(part.shape.size(), 0.0);
      const VectorXd without = residual(judged.offsets(), judged.delta - all + part_of[p]);
      effect.closure = (without.squaredNorm() - judged_after.squaredNorm()) / gap;
      Set less = set;
      less.parts.erase(less.parts.begin() + static_cast<std::ptrdiff_t>(p));
      fit(rows, colour(rows, residual(design(rows, set.parts), rows.delta)), less);
      Set again = set;
      fit(rows, colour(rows, residual(design(rows, set.parts), rows.delta)), again);
      effect.score = again.score - less.score;
      bool alike = false;
      Index old_at = 0;
      for (const Part& was : old.parts) {
        const auto old_count = static_cast<Index>(find_effect(was.effect)->linear.size());
        if (was.effect == part.effect) {
          const double then = size_of(rows, was, old.theta.segment(old_at, old_count)),
                       today = size_of(rows, part, theta);
          alike = std::fabs(today - then) < same_share * then;
        }
        old_at += old_count;
      }
      (alike ? learned[j] : found[j].found).push_back(std::move(effect));
    }
  });
  Deflections out;
  for (std::size_t j = 0; j < n; ++j) {
    out.found.insert(out.found.end(), found[j].found.begin(), found[j].found.end());
    out.notes.insert(out.notes.end(), found[j].notes.begin(), found[j].notes.end());
    background.insert(background.end(), learned[j].begin(), learned[j].end());
  }
  return out;
}

}  // namespace fxdyn::diagnosis
