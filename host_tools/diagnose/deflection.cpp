#include "host_tools/diagnose/deflection.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "host_tools/diagnose/autoregression.hpp"
#include "host_tools/diagnose/linearised.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double least_score = 12;
constexpr double least_closure = 0.5;
/// Of the power of all parts.
constexpr double least_part = 0.05;
/// Times the noise: a deflection without a name that is told of.
constexpr double worth_a_word = 2;
/// A parameter that differs by less than this share from the healthy session's has not changed.
constexpr double same_share = 0.33;

/// Rows of one joint's logs.
struct Rows {
  std::vector<const ProcessedLog*> logs;
  std::vector<JointSeries> series;
  std::vector<Index> first, count;
  VectorXd delta;
  std::size_t joint = 0;
  double width = 0.01;
  std::vector<MatrixXd> slopes;  ///< d load / d z by log, at full rate; empty: the load is taken as it is
  VectorXd z;                    ///< of the base parameters, in units of their standard deviations: 0, 1 a priori

  /// The load with the base parameters elsewhere.
  void move(const VectorXd& to) {
    for (std::size_t l = 0; l < logs.size(); ++l) series[l].structural += slopes[l] * (to - z);
    z = to;
  }

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
    MatrixXd out(x.rows(), x.cols());
    for (std::size_t l = 0; l < logs.size(); ++l)
      out.middleRows(first[l], count[l]) = prewhitened(x.middleRows(first[l], count[l]), a);
    return out;
  }
};

/// The torque of the rigid body, all joints.
std::vector<MatrixXd> loads(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs) {
  IdentifiedModel rigid = model;
  for (JointFit& fit : rigid.joints) fit.effects.clear();
  rigid.filter.torque_lead_s = 0;
  std::vector<MatrixXd> out(logs.size());
  parallel_for(logs.size(), [&](std::size_t l) {
    if (logs[l].qlink.size() > 0) out[l] = predict(rigid, logs[l]);
  });
  return out;
}

struct LinkedLog {
  const ProcessedLog* log;
  const MatrixXd* load;
};

Rows rows_of(const IdentifiedModel& model, const std::vector<LinkedLog>& logs, std::size_t joint) {
  Rows rows;
  rows.joint = joint;
  rows.width = model.joints[joint].sign_width;
  const auto j = static_cast<Index>(joint);
  Index total = 0;
  for (const auto& [log, load] : logs) {
    MotionRows m = log->joint_motion(j);
    JointSeries series{m.q, m.dq, m.ddq, load->col(j), log->step_s};
    rows.series.push_back(std::move(series));
    rows.logs.push_back(log);
    rows.first.push_back(total);
    rows.count.push_back(log->rows());
    total += log->rows();
  }
  rows.delta.resize(total);
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const ProcessedLog& log = *rows.logs[l];
    const MatrixXd delta = log.filter_columns((log.q - log.qlink).col(j));
    rows.delta.segment(rows.first[l], rows.count[l]) = log.decimate(delta);
  }
  return rows;
}

/// How the load follows from base parameters that are uncertain, Y_j L with covariance = L L^T: along the directions in
/// which the load itself is uncertain by more than a share of it.
struct Uncertain {
  MatrixXd spread;  ///< of base parameters [columns x directions]
  std::vector<Index> columns;
  double rotor = 0;  ///< one more direction: so much of the inertia is a rotor's, a priori; 0: none is hidden
};

/// Half of what a rotor can have at most, 0 where the base parameters have none.
double hidden_rotor(const Rows& rows, const IdentifiedModel& model) {
  if (rotor_of(model.joints[rows.joint]) != nullptr) return 0;
  if (!rotor_inertia_is_absorbed(to_dh(model.robot), base_of(model), static_cast<Index>(rows.joint))) return 0;
  std::vector<const MatrixXd*> q;
  for (const ProcessedLog* log : rows.logs) q.push_back(&log->q);
  return 0.5 * least_inertia(model, rows.joint, q);
}

MatrixXd slopes_of(const ProcessedLog& log, const JointSeries& series, std::size_t joint, const IdentifiedModel& model,
                   const Uncertain& u) {
  Regressor regressor(to_dh(model.robot));
  const MotionRows m = log.motion();
  MatrixXd own(log.samples(), static_cast<Index>(u.columns.size()));
  for (Index k = 0; k < own.rows(); ++k) {
    const MatrixXd& y = regressor(m.q.row(k), m.dq.row(k), m.ddq.row(k));
    for (Index c = 0; c < own.cols(); ++c)
      own(k, c) = y(static_cast<Index>(joint), u.columns[static_cast<std::size_t>(c)]);
  }
  MatrixXd out(own.rows(), u.spread.cols() + (u.rotor > 0));
  out.leftCols(u.spread.cols()) = own * u.spread;
  if (u.rotor > 0) out.rightCols(1) = -u.rotor * series.ddq;
  return out;
}

/// Gives the rows their slopes. @param u as before, or to be found
void add_slopes(Rows& rows, const IdentifiedModel& model, const Uncertain& u) {
  rows.slopes.clear();
  for (std::size_t l = 0; l < rows.logs.size(); ++l)
    rows.slopes.push_back(slopes_of(*rows.logs[l], rows.series[l], rows.joint, model, u));
  rows.z = VectorXd::Zero(rows.slopes.front().cols());
}

Uncertain uncertainty(Rows& rows, const IdentifiedModel& model, const MatrixXd& covariance, bool with_rotor) {
  constexpr double little = 1e-3;  // of the load
  Uncertain u;
  const auto j = static_cast<Index>(rows.joint);
  std::vector<Index> mine;  // those of links from the joint on
  for (std::size_t k = 0; k < model.base.size(); ++k) {
    const auto column = static_cast<Index>(model.base[k].column);
    if (column < j * static_cast<Index>(parameters_per_link)) continue;
    mine.push_back(static_cast<Index>(k));
    u.columns.push_back(column);
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(covariance(mine, mine));
  u.spread = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  add_slopes(rows, model, u);
  MatrixXd gram = MatrixXd::Zero(rows.z.size(), rows.z.size());
  double load = 0;
  for (std::size_t l = 0; l < rows.logs.size(); ++l) {
    gram += rows.slopes[l].transpose() * rows.slopes[l];
    load += rows.series[l].structural.squaredNorm();
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> principal(gram);
  std::vector<Index> kept;
  for (Index i = 0; i < gram.rows(); ++i) {
    if (principal.eigenvalues()[i] > little * little * load) kept.push_back(i);
  }
  u.spread = u.spread * principal.eigenvectors()(Eigen::all, kept);
  if (with_rotor) u.rotor = hidden_rotor(rows, model);
  add_slopes(rows, model, u);
  return u;
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
  double likelihood = -1e300;  ///< score whatever the signs of the coefficients
  double noise = 0;            ///< variance of the whitened residual
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
  std::vector<VectorXd> parts;
  for (std::size_t l = 0; l < rows.logs.size(); ++l) parts.emplace_back(e.segment(rows.first[l], rows.count[l]));
  return autoregression(parts);
}

VectorXd residual(const MatrixXd& x, const VectorXd& y) {
  return y - x * SymmetricSolver(x.transpose() * x).solve(x.transpose() * y);
}

double largest_load(const Rows& rows) {
  double most = 1e-6;
  for (const JointSeries& s : rows.series) most = std::max(most, s.structural.cwiseAbs().maxCoeff());
  return most;
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
    // A gap whose flanks no load reaches is in proportion to it: an elasticity.
    for (std::size_t i = 0; i < info.shape.size(); ++i) {
      if (info.shape[i].quantity == Quantity::inverse_torque) possible &= part.shape[i] <= largest_load(rows);
    }
  }
  set.likelihood = -n * std::log(std::max(set.square, 1e-300) / n) - penalty;
  set.score = possible ? set.likelihood : -1e300;
}

/// The values of a shape parameter on a link encoder: where a fit begins, then what it tries.
ValueList link_values(const ParameterInfo& shape, double largest_load) {
  MotionScales scales;
  scales.structural = largest_load;
  return shape.values.of_link(scales);
}

/// All effects on the position, with middling shapes.
std::vector<Part> all_parts(double largest) {
  std::vector<Part> parts;
  for (const EffectInfo& info : effect_infos()) {
    if (info.acts_on != ActsOn::position) continue;
    parts.push_back({std::string(info.name), {}});
    for (const ParameterInfo& shape : info.shape) parts.back().shape.push_back(link_values(shape, largest)[0]);
  }
  return parts;
}

/// Shapes one after the other: over a grid, then around.
void tune(const Rows& rows, const VectorXd& a, Set& set, bool from_grid) {
  const double largest = largest_load(rows);
  for (int round = from_grid ? 0 : 1; round < 2; ++round) {
    for (std::size_t p = 0; p < set.parts.size(); ++p) {
      if (set.parts[p].shape.empty()) continue;
      const double now = set.parts[p].shape[0];
      std::vector<double> values{0.7 * now, 0.85 * now, 1.18 * now, 1.4 * now};
      const ParameterInfo& info = find_effect(set.parts[p].effect)->shape[0];
      if (round == 0) {
        const ValueList grid = link_values(info, largest);
        values.assign(grid.begin() + 1, grid.end());
      }
      for (const double value : values) {
        Set other = set;
        other.parts[p].shape[0] = std::clamp(value, info.lower, info.upper);
        fit(rows, a, other);
        if (other.score > set.score) set = std::move(other);
      }
    }
  }
}

bool any_bends(const Set& set) {
  return std::any_of(set.parts.begin(), set.parts.end(), [](const Part& part) { return bends(part.effect); });
}

/// A set with the load where torque and deflection together have it most likely: Gauss-Newton over coefficients and z.
struct Moved {
  Set set;
  VectorXd z;
  double score = -1e300;  ///< of the set, less what the load's move costs and what it was free to do (Laplace)
};

Moved move_load(const Rows& start, const VectorXd& a, const Set& from) {
  constexpr int most_rounds = 8;
  constexpr double h = 0.02;  // of a standard deviation
  Rows rows = start;
  Moved best{from, rows.z, from.score};
  if (rows.z.size() == 0 || !any_bends(from)) return best;
  double cost = -from.score + rows.z.squaredNorm();
  for (int round = 0; round < most_rounds; ++round) {
    const MatrixXd own = design(rows, best.set.parts);
    const Index first = own.cols();
    MatrixXd x(own.rows(), first + rows.z.size());
    x.leftCols(first) = own;
    VectorXd theta = VectorXd::Zero(first);
    theta.tail(best.set.theta.size()) = best.set.theta;
    for (Index i = 0; i < rows.z.size(); ++i) {
      Rows moved = rows;
      const VectorXd step = VectorXd::Unit(rows.z.size(), i) * h;
      moved.move(rows.z + step);
      const MatrixXd there = design(moved, best.set.parts);
      moved.move(rows.z - step);
      x.col(first + i) = (there - design(moved, best.set.parts)) * theta / (2 * h);
    }
    x = rows.whiten(x, a);
    MatrixXd gram = x.transpose() * x;
    // What the load at z makes stays on the other side; a priori z is 0 with variance 1.
    const VectorXd right = x.transpose() * (rows.whiten(rows.delta, a) + x.rightCols(rows.z.size()) * rows.z);
    const VectorXd free = (1 + gram.diagonal().tail(rows.z.size()).array() / best.set.noise).log();
    best.score = -cost - free.sum();
    best.z = rows.z;
    if (round == most_rounds - 1) break;
    gram.diagonal().tail(rows.z.size()).array() += best.set.noise;
    const VectorXd step = SymmetricSolver(gram).solve(right).tail(rows.z.size()) - rows.z, at = rows.z;
    bool better = false;
    for (double share = 1; share > 0.05 && !better; share *= 0.4) {
      rows.move(at + share * step);
      Set set = best.set;
      fit(rows, a, set);
      tune(rows, a, set, round == 0);
      const double now = -set.score + rows.z.squaredNorm();
      better = now < cost - 0.5;
      if (!better) continue;
      best.set = std::move(set);
      cost = now;
    }
    if (better) continue;
    rows.move(at);
    break;
  }
  return best;
}

/// z at which the load is in proportion to the deflection, as near to the torque's load as that allows: with z_v the
/// deflection's fit by the slopes and z_s that of the load at z = 0,
///   z = alpha z_v - z_s, alpha = (z_v . z_s) / |z_v|^2, at least 1 / |z_v|.
VectorXd likely_load(const Rows& rows, const VectorXd& a) {
  MatrixXd all(rows.delta.size(), rows.z.size());
  VectorXd load(rows.delta.size());
  for (std::size_t l = 0; l < rows.logs.size(); ++l) {
    const ProcessedLog& log = *rows.logs[l];
    all.middleRows(rows.first[l], rows.count[l]) = log.decimate(log.filter_columns(rows.slopes[l]));
    load.segment(rows.first[l], rows.count[l]) = log.decimate(log.filter_columns(rows.series[l].structural));
  }
  const MatrixXd white = rows.whiten(all, a), offsets = rows.whiten(rows.offsets(), a);
  MatrixXd x(white.rows(), white.cols() + offsets.cols());
  x << white, offsets;
  const SymmetricSolver solver(x.transpose() * x);
  const VectorXd v = solver.solve(x.transpose() * rows.whiten(rows.delta, a)).head(white.cols());
  if (!(v.squaredNorm() > 0)) return rows.z;
  const VectorXd s = SymmetricSolver(all.transpose() * all).solve(all.transpose() * load);
  return std::max(v.dot(s) / v.squaredNorm(), 1 / v.norm()) * v - s;
}

/// Forward: the effect that brings most, as long as one brings something; the load moves with it.
Set best_set(Rows& rows, const IdentifiedModel& model, const MatrixXd& covariance, Uncertain& uncertain,
             bool with_rotor = true) {
  const std::vector<Part> full = all_parts(largest_load(rows));
  // Colour of what no set explains.
  const VectorXd a = colour(rows, residual(design(rows, full), rows.delta));
  Moved best;
  fit(rows, a, best.set);
  best.score = best.set.score;
  for (std::size_t level = 0; level < full.size(); ++level) {
    std::vector<Moved> next;
    for (const Part& part : full) {
      Moved more = best;
      if (std::any_of(more.set.parts.begin(), more.set.parts.end(),
                      [&](const Part& other) { return other.effect == part.effect; }))
        continue;
      more.set.parts.push_back(part);
      fit(rows, a, more.set);
      tune(rows, a, more.set, true);
      next.push_back(std::move(more));
    }
    double most = -1e300;
    for (const Moved& one : next) most = std::max(most, one.set.score);
    if (most < best.set.score + least_score) break;
    if (level == 0 && covariance.size() > 0) uncertain = uncertainty(rows, model, covariance, with_rotor);
    std::size_t chosen = 0;
    for (Moved& one : next) one = move_load(rows, a, one.set);
    if (level == 0 && rows.z.size() > 0) {
      // Where the torque tells little of the load, even its signs, the way there begins at what the deflection tells.
      Rows there = rows;
      there.move(likely_load(rows, a));
      for (std::size_t i = 0; i < 2; ++i) {
        Set set;
        set.parts = {full[i]};
        fit(there, a, set);
        tune(there, a, set, true);
        if (set.score == -1e300) continue;
        Moved moved = move_load(there, a, set);
        if (moved.score > next[i].score) next[i] = std::move(moved);
      }
    }
    for (std::size_t i = 0; i < next.size(); ++i) {
      if (next[i].score > next[chosen].score) chosen = i;
    }
    if (next[chosen].score < best.score + least_score) break;
    best = next[chosen];
    if (best.z.size() > 0) rows.move(best.z);
  }
  return best.set;
}

/// RMS of a part's deflection over the rows.
double size_of(const Rows& rows, const Part& part, const VectorXd& theta) {
  VectorXd d = rows.columns(part.effect, part.shape) * theta;
  d.array() -= d.mean();
  return d.norm() / std::sqrt(static_cast<double>(d.size()));
}

}  // namespace

Deflections find_deflections(const IdentifiedModel& model, const MatrixXd& base_covariance,
                             const std::vector<ProcessedLog>& now, const std::vector<ProcessedLog>& before,
                             std::vector<DeflectionEffect>& background) {
  const std::size_t n = model.joints.size();
  IdentifiedModel healthy_model = model;  // without today's load
  std::erase_if(healthy_model.body, [](const EffectFit& fit) { return fit.named; });
  const std::vector<MatrixXd> load_now = loads(model, now), load_before = loads(healthy_model, before);
  std::vector<Deflections> found(n);
  std::vector<std::vector<DeflectionEffect>> learned(n);
  parallel_for(n, [&](std::size_t j) {
    const auto with_link = [&](const std::vector<ProcessedLog>& logs, const std::vector<MatrixXd>& load,
                               std::optional<Role> role) {
      std::vector<LinkedLog> out;
      for (std::size_t l = 0; l < logs.size(); ++l) {
        if (logs[l].qlink.size() > 0 && logs[l].has_link[j] && (!role || logs[l].role == *role))
          out.push_back({&logs[l], &load[l]});
      }
      return out;
    };
    const auto train = with_link(now, load_now, Role::train), judge = with_link(now, load_now, Role::validate),
               healthy = with_link(before, load_before, {});
    if (train.empty()) return;
    Rows rows = rows_of(model, train, j);
    Uncertain uncertain;
    Set set = best_set(rows, model, base_covariance, uncertain);
    double rotor = uncertain.rotor > 0 ? uncertain.rotor * rows.z.tail(1)[0] : 0;
    if (rotor < 0) {
      // No rotor has less than nothing.
      rows = rows_of(model, train, j);
      uncertain = {};
      set = best_set(rows, model, base_covariance, uncertain, false);
      rotor = 0;
    }
    // Other logs of the joint with the load that was found.
    const auto others = [&](const std::vector<LinkedLog>& logs) {
      Rows out = rows_of(model, logs, j);
      if (rows.z.size() == 0) return out;
      add_slopes(out, model, uncertain);
      out.move(rows.z);
      return out;
    };
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
      old_rows = others(healthy);
      // The load stays where today's deflection has it: only the product with the compliance is known.
      old_rows->slopes.clear();
      old_rows->z.resize(0);
      Uncertain same;
      old = best_set(*old_rows, model, {}, same);
    }
    // What judges, with coefficients fitted to something else: the validate logs, or each train log by the others.
    struct Judged {
      Rows rows;
      VectorXd theta;
    };
    std::vector<Judged> folds;
    const bool held_out = !judge.empty() || train.size() > 1;
    if (!judge.empty()) {
      folds.push_back({others(judge), set.theta});
    } else if (!held_out) {
      folds.push_back({rows, set.theta});
    } else {
      const VectorXd a = colour(rows, residual(design(rows, set.parts), rows.delta));
      for (std::size_t l = 0; l < train.size(); ++l) {
        std::vector<LinkedLog> rest = train;
        rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(l));
        Set other = set;
        fit(others(rest), a, other);
        folds.push_back({others({train[l]}), other.theta});
      }
    }
    double square = 0, after = 0, white = 0;
    std::vector<double> without(set.parts.size(), 0.0);
    for (const Judged& fold : folds) {
      const Rows& judged = fold.rows;
      std::vector<VectorXd> part_of;
      VectorXd all = VectorXd::Zero(judged.delta.size());
      Index at = 0;
      for (const Part& part : set.parts) {
        const auto count = static_cast<Index>(find_effect(part.effect)->linear.size());
        part_of.push_back(judged.columns(part.effect, part.shape) * fold.theta.segment(at, count));
        all += part_of.back();
        at += count;
      }
      const auto left = [&](const VectorXd& taken) {
        return residual(judged.offsets(), judged.delta - taken).squaredNorm();
      };
      square += left(VectorXd::Zero(all.size()));
      after += left(all);
      // The noise of the two encoders is no gap.
      white += set.noise * static_cast<double>(all.size());
      for (std::size_t p = 0; p < part_of.size(); ++p) without[p] += left(all - part_of[p]);
    }
    const double gap = std::max(square - std::min(after, white), 1e-300), closure = (square - after) / gap;
    if (closure < least_closure) {
      // .. and so little that encoders may make it themselves is not worth a word.
      if (square < worth_a_word * white) return;
      found[j].notes.push_back(fmt::format("{}: the deflection that the link encoder shows is none that has a name",
                                           model.robot.joints[j].name));
      return;
    }
    const VectorXd a = colour(rows, residual(design(rows, set.parts), rows.delta));
    Index at = 0;
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
      effect.closure = (without[p] - after) / gap;
      effect.held_out = held_out;
      if (bends(part.effect)) effect.rotor = rotor;
      Set less = set, again = set;
      less.parts.erase(less.parts.begin() + static_cast<std::ptrdiff_t>(p));
      fit(rows, a, less);
      fit(rows, a, again);
      effect.score = again.likelihood - less.likelihood;
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
