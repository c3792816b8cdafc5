#include "host_tools/diagnose/deflection_fit.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "host_tools/diagnose/deflection_polish.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/regression/gauss_newton.hpp"
#include "host_tools/regression/solver.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The values of a shape parameter on a link encoder: where a fit begins, then what it tries.
ValueList link_values(const ParameterInfo& shape, double largest_load) {
  MotionScales scales;
  scales.structural = largest_load;
  return shape.values.of_link(scales);
}

/// All effects on the position, with middling shapes.
std::vector<DeflectionPart> all_parts(double largest) {
  std::vector<DeflectionPart> parts;
  for (const EffectInfo& info : effect_infos()) {
    if (info.acts_on != ActsOn::position) continue;
    parts.push_back({std::string(info.name), {}});
    for (const ParameterInfo& shape : info.shape) parts.back().shape.push_back(link_values(shape, largest)[0]);
  }
  return parts;
}

/// Shapes one after the other: over a grid, then around.
void tune(const DeflectionRows& rows, const VectorXd& a, DeflectionSet& set, bool from_grid) {
  const double largest = rows.largest_load();
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
        DeflectionSet other = set;
        other.parts[p].shape[0] = std::clamp(value, info.lower, info.upper);
        fit(rows, a, other);
        if (other.score > set.score) set = std::move(other);
      }
    }
  }
}

bool any_bends(const DeflectionSet& set) {
  return std::any_of(set.parts.begin(), set.parts.end(), [](const DeflectionPart& part) { return bends(part.effect); });
}

/// A set with the load where torque and deflection together have it most likely.
struct Moved {
  DeflectionSet set;
  VectorXd z;
  double score = -1e300;  ///< of the set, less what the load's move costs and what it was free to do (Laplace)
};

/// Gauss-Newton over coefficients and z.
Moved move_load(const DeflectionRows& start, const VectorXd& a, const DeflectionSet& from) {
  constexpr int most_rounds = 8;
  DeflectionRows rows = start;
  Moved best{from, rows.z(), from.score};
  if (rows.z().size() == 0 || !any_bends(from)) return best;
  const Index directions = rows.z().size();
  double cost = -from.score + rows.z().squaredNorm();
  const auto step_of = [&](const VectorXd& here, int round) -> std::optional<VectorXd> {
    const MatrixXd own = design(rows, best.set.parts);
    const Index first = own.cols();
    MatrixXd x(own.rows(), first + directions);
    x.leftCols(first) = own;
    x.rightCols(directions) = load_slopes(rows, best.set);
    x = rows.whiten(x, a);
    MatrixXd gram = x.transpose() * x;
    // What the load at z makes stays on the other side; a priori z is 0 with variance 1.
    const VectorXd right = x.transpose() * (rows.whiten(rows.delta(), a) + x.rightCols(directions) * rows.z());
    const VectorXd free = (1 + gram.diagonal().tail(directions).array() / best.set.noise).log();
    best.score = -cost - free.sum();
    best.z = rows.z();
    if (round == most_rounds - 1) return {};
    gram.diagonal().tail(directions).array() += best.set.noise;
    return SymmetricSolver(gram).solve(right).tail(directions) - here;
  };
  const auto accept = [&](const VectorXd& there, int round) {
    rows.move(there);
    DeflectionSet set = best.set;
    fit(rows, a, set);
    tune(rows, a, set, round == 0);
    const double now = -set.score + rows.z().squaredNorm();
    if (!(now < cost - 0.5)) return false;
    best.set = std::move(set);
    cost = now;
    return true;
  };
  gauss_newton(rows.z(), {.most_rounds = most_rounds}, step_of, accept);
  return best;
}

/// z at which the load is in proportion to the deflection, as near to the torque's load as that allows: with z_v the
/// deflection's fit by the slopes and z_s that of the load at z = 0,
///   z = alpha z_v - z_s, alpha = (z_v . z_s) / |z_v|^2, at least 1 / |z_v|.
VectorXd likely_load(const DeflectionRows& rows, const VectorXd& a) {
  const MatrixXd all = rows.slope_rows();
  const MatrixXd white = rows.whiten(all, a), offsets = rows.whiten(rows.offsets(), a);
  MatrixXd x(white.rows(), white.cols() + offsets.cols());
  x << white, offsets;
  const SymmetricSolver solver(x.transpose() * x);
  const VectorXd v = solver.solve(x.transpose() * rows.whiten(rows.delta(), a)).head(white.cols());
  if (!(v.squaredNorm() > 0)) return rows.z();
  const VectorXd s = SymmetricSolver(all.transpose() * all).solve(all.transpose() * rows.load_rows());
  return std::max(v.dot(s) / v.squaredNorm(), 1 / v.norm()) * v - s;
}

/// Where the torque determines little of the load, even its signs, the way there begins at the load that the deflection
/// suggests.
void try_likely_load(const DeflectionRows& rows, const VectorXd& a, const std::vector<DeflectionPart>& full,
                     std::vector<Moved>& next) {
  DeflectionRows there = rows;
  there.move(likely_load(rows, a));
  for (std::size_t i = 0; i < 2; ++i) {
    DeflectionSet set;
    set.parts = {full[i]};
    fit(there, a, set);
    tune(there, a, set, true);
    if (set.score == -1e300) continue;
    Moved moved = move_load(there, a, set);
    if (moved.score > next[i].score) next[i] = std::move(moved);
  }
}

/// A set with each of the parts that it does not have.
std::vector<Moved> extended(const DeflectionRows& rows, const VectorXd& a, const Moved& best,
                            const std::vector<DeflectionPart>& full) {
  std::vector<Moved> out;
  for (const DeflectionPart& part : full) {
    Moved more = best;
    if (std::any_of(more.set.parts.begin(), more.set.parts.end(),
                    [&](const DeflectionPart& other) { return other.effect == part.effect; }))
      continue;
    more.set.parts.push_back(part);
    fit(rows, a, more.set);
    tune(rows, a, more.set, true);
    out.push_back(std::move(more));
  }
  return out;
}

}  // namespace

Index DeflectionSet::count(std::size_t part) const {
  return static_cast<Index>(find_effect(parts[part].effect)->linear.size());
}

Index DeflectionSet::first(std::size_t part) const {
  Index out = 0;
  for (std::size_t p = 0; p < part; ++p) out += count(p);
  return out;
}

MatrixXd design(const DeflectionRows& rows, const std::vector<DeflectionPart>& parts) {
  MatrixXd x = rows.offsets();
  for (const DeflectionPart& part : parts) {
    const MatrixXd c = rows.columns(part.effect, part.shape);
    x.conservativeResize(Eigen::NoChange, x.cols() + c.cols());
    x.rightCols(c.cols()) = c;
  }
  return x;
}

void fit(const DeflectionRows& rows, const VectorXd& a, DeflectionSet& set) {
  const MatrixXd x = rows.whiten(design(rows, set.parts), a);
  const VectorXd y = rows.whiten(rows.delta(), a);
  const SymmetricSolver solver(x.transpose() * x);
  const VectorXd theta = solver.solve(x.transpose() * y);
  const auto n = static_cast<double>(y.size());
  set.square = (y - x * theta).squaredNorm();
  // The first rows of each log have no past: whitening leaves them out.
  const auto lost = static_cast<double>(a.size()) * static_cast<double>(rows.logs());
  set.noise = set.square / std::max(n - lost, 1.0);
  const Index own = x.cols() - static_cast<Index>(rows.logs());
  set.theta = theta.tail(own);
  set.std = (solver.inverse().diagonal().tail(own) * set.noise).cwiseMax(0).cwiseSqrt();
  double penalty = 0;
  Index coefficient = 0;
  bool possible = true;
  for (const DeflectionPart& part : set.parts) {
    const EffectInfo& info = *find_effect(part.effect);
    penalty += static_cast<double>(info.linear.size() + info.shape.size()) * std::log(n) +
               2 * std::log(part.shape.empty() ? 1.0 : 4.0);
    for (const ParameterInfo& p : info.linear) possible &= set.theta[coefficient++] >= p.lower;
    // A gap whose flanks no load reaches is in proportion to it: an elasticity.
    for (std::size_t i = 0; i < info.shape.size(); ++i) {
      if (info.shape[i].quantity == Quantity::inverse_torque) possible &= part.shape[i] <= rows.largest_load();
    }
  }
  set.likelihood = -n * std::log(std::max(set.square, 1e-300) / n) - penalty;
  set.score = possible ? set.likelihood : -1e300;
}

DeflectionSet best_set(DeflectionRows& rows, const IdentifiedModel& model, const MatrixXd& covariance,
                       LoadUncertainty& uncertainty, const DeflectionOptions& options, bool with_rotor) {
  const std::vector<DeflectionPart> full = all_parts(rows.largest_load());
  // Colour of what no set explains.
  const VectorXd a = rows.colour(residual(design(rows, full), rows.delta()));
  Moved best;
  fit(rows, a, best.set);
  best.score = best.set.score;
  for (std::size_t level = 0; level < full.size(); ++level) {
    std::vector<Moved> next = extended(rows, a, best, full);
    double most = -1e300;
    for (const Moved& one : next) most = std::max(most, one.set.score);
    if (most < best.set.score + options.least_score) break;
    if (level == 0 && covariance.size() > 0) uncertainty = rows.add_uncertainty(model, covariance, options, with_rotor);
    for (Moved& one : next) one = move_load(rows, a, one.set);
    if (level == 0 && rows.z().size() > 0) try_likely_load(rows, a, full, next);
    const auto chosen =
        std::max_element(next.begin(), next.end(), [](const Moved& x, const Moved& y) { return x.score < y.score; });
    if (chosen->score < best.score + options.least_score) break;
    best = *chosen;
    if (best.z.size() > 0) rows.move(best.z);
  }
  return best.set;
}

double size_of(const DeflectionRows& rows, const DeflectionPart& part, const VectorXd& theta) {
  VectorXd d = rows.columns(part.effect, part.shape) * theta;
  d.array() -= d.mean();
  return d.norm() / std::sqrt(static_cast<double>(d.size()));
}

}  // namespace fxdyn::diagnosis
