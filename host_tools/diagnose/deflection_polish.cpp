#include "host_tools/diagnose/deflection_polish.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "host_tools/effects/effects.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/regression/gauss_newton.hpp"
#include "host_tools/regression/solver.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Parts whose shape is inside its bounds: it can be refined, and has a deviation.
std::vector<std::size_t> with_shape(const DeflectionSet& set) {
  std::vector<std::size_t> out;
  for (std::size_t p = 0; p < set.parts.size(); ++p) {
    if (set.parts[p].shape.empty()) continue;
    const ParameterInfo& info = find_effect(set.parts[p].effect)->shape[0];
    const double now = set.parts[p].shape[0];
    if (now > std::max(info.lower, 0.0) && now < info.upper) out.push_back(p);
  }
  return out;
}

/// d deflection / d ln shape by central differences, rows x parts.
MatrixXd shape_slopes(const DeflectionRows& rows, const DeflectionSet& set, const std::vector<std::size_t>& parts) {
  constexpr double h = 0.02;
  MatrixXd out(rows.delta().size(), static_cast<Index>(parts.size()));
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const DeflectionPart& part = set.parts[parts[i]];
    const auto at = [&](double factor) { return rows.columns(part.effect, {part.shape[0] * factor}); };
    out.col(static_cast<Index>(i)) = (at(std::exp(h)) - at(std::exp(-h))) * set.theta_of(parts[i]) / (2 * h);
  }
  return out;
}

/// The linearised deflection, whitened.
struct Linear {
  MatrixXd x;       ///< offsets and coefficients, shapes, load
  VectorXd rest;    ///< what is left of the deflection
  Index first = 0;  ///< offsets and coefficients
  /// X^T X and what is known a priori.
  MatrixXd gram(Index directions, double noise) const {
    MatrixXd out = x.transpose() * x;
    out.diagonal().tail(directions).array() += noise;
    return out;
  }
};

Linear linear(const DeflectionRows& rows, const VectorXd& colour, const DeflectionSet& set,
              const std::vector<std::size_t>& parts) {
  const MatrixXd own = design(rows, set.parts);
  Linear out;
  out.first = own.cols();
  out.x.resize(own.rows(), own.cols() + static_cast<Index>(parts.size()) + rows.z().size());
  out.x << own, shape_slopes(rows, set, parts), load_slopes(rows, set);
  out.x = rows.whiten(out.x, colour);
  out.rest = residual(out.x.leftCols(out.first), rows.whiten(rows.delta(), colour));
  return out;
}

}  // namespace

MatrixXd load_slopes(const DeflectionRows& rows, const DeflectionSet& set) {
  constexpr double h = 0.02;  // of a standard deviation
  MatrixXd out = MatrixXd::Zero(rows.delta().size(), rows.z().size());
  for (Index i = 0; i < out.cols(); ++i) {
    DeflectionRows moved = rows;
    const VectorXd step = VectorXd::Unit(out.cols(), i) * h;
    for (std::size_t p = 0; p < set.parts.size(); ++p) {
      if (!bends(set.parts[p].effect)) continue;
      moved.move(rows.z() + step);
      const MatrixXd there = moved.columns(set.parts[p].effect, set.parts[p].shape);
      moved.move(rows.z() - step);
      out.col(i) += (there - moved.columns(set.parts[p].effect, set.parts[p].shape)) * set.theta_of(p) / (2 * h);
    }
  }
  return out;
}

void polish(DeflectionRows& rows, const VectorXd& colour, DeflectionSet& set) {
  const std::vector<std::size_t> parts = with_shape(set);
  const auto shapes = static_cast<Index>(parts.size());
  const Index directions = rows.z().size();
  if (shapes + directions == 0) return;
  fit(rows, colour, set);
  double cost = -set.score + rows.z().squaredNorm();
  VectorXd start(shapes + directions);
  for (std::size_t i = 0; i < parts.size(); ++i) start[static_cast<Index>(i)] = std::log(set.parts[parts[i]].shape[0]);
  start.tail(directions) = rows.z();
  const auto step_of = [&](const VectorXd& here, int) -> std::optional<VectorXd> {
    const Linear problem = linear(rows, colour, set, parts);
    VectorXd right = problem.x.transpose() * problem.rest;
    right.tail(directions) -= set.noise * here.tail(directions);
    VectorXd step = SymmetricSolver(problem.gram(directions, set.noise)).solve(right).tail(here.size());
    step.head(shapes) = step.head(shapes).cwiseMax(-0.5).cwiseMin(0.5);
    return step;
  };
  const auto accept = [&](const VectorXd& there, int) {
    DeflectionRows moved = rows;
    if (directions > 0) moved.move(there.tail(directions));
    DeflectionSet next = set;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const ParameterInfo& info = find_effect(set.parts[parts[i]].effect)->shape[0];
      next.parts[parts[i]].shape[0] = std::clamp(std::exp(there[static_cast<Index>(i)]), info.lower, info.upper);
    }
    fit(moved, colour, next);
    const double now = -next.score + moved.z().squaredNorm();
    if (!(now < cost - 1e-3)) return false;
    cost = now;
    set = std::move(next);
    rows = std::move(moved);
    return true;
  };
  gauss_newton(start, {.most_rounds = 12}, step_of, accept);
}

void add_deviations(DeflectionRows rows, const VectorXd& colour, const IdentifiedModel& model,
                    const MatrixXd& covariance, bool with_rotor, DeflectionSet& set) {
  if (covariance.size() > 0) {
    DeflectionOptions all;
    all.load_uncertainty = 0;
    rows.add_uncertainty(model, covariance, all, with_rotor);
  } else {
    rows.drop_slopes();
  }
  const std::vector<std::size_t> parts = with_shape(set);
  const Linear problem = linear(rows, colour, set, parts);
  const VectorXd variances =
      SymmetricSolver(problem.gram(rows.z().size(), set.noise)).inverse().diagonal().cwiseMax(0) * set.noise;
  set.std = variances.segment(problem.first - set.theta.size(), set.theta.size()).cwiseSqrt();
  set.shape_std.assign(set.parts.size(), 0.0);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const double relative = std::sqrt(variances[problem.first + static_cast<Index>(i)]);
    set.shape_std[parts[i]] = relative * set.parts[parts[i]].shape[0];
  }
}

}  // namespace fxdyn::diagnosis
