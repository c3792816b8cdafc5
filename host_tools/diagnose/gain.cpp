#include "host_tools/diagnose/gain.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/effects/effects.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Bounds below are none.
constexpr double no_bound = -1e5;

Gain gain_of_one(double gram, double projection, const Reduced& reduced, double scale, double lower, bool share) {
  Gain out;
  out.theta = VectorXd::Zero(1);
  out.kept = gram;
  if (out.kept < nothing_left) return out;
  out.rank = 1;
  const double theta = projection / gram;
  out.theta[0] = theta * scale;
  if (out.theta[0] < lower) return out;
  // A share that is 1 by definition counts with 1.
  out.square = share ? 2 * reduced.projection[0] - reduced.gram(0, 0) : theta * projection;
  return out;
}

}  // namespace

Gain gain_of(const Reduced& reduced, const std::vector<double>& lower, bool share, double beyond) {
  const Index p = reduced.gram.rows();
  const VectorXd scale = reduced.size.unaryExpr([](double x) { return x > 0 ? 1 / std::sqrt(x) : 0.0; });
  const MatrixXd g = scale.asDiagonal() * reduced.gram * scale.asDiagonal();
  const VectorXd b = scale.cwiseProduct(reduced.projection);
  if (p == 1) return gain_of_one(g(0, 0), b[0], reduced, scale[0], lower[0], share);
  Gain out;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(g);
  out.kept = eigen.eigenvalues()[p - 1];
  VectorXd theta = VectorXd::Zero(p);
  for (Index i = 0; i < p; ++i) {
    const double value = eigen.eigenvalues()[i];
    if (value < nothing_left) continue;
    ++out.rank;
    const double along = eigen.eigenvectors().col(i).dot(b);
    out.square += along * along / value;
    theta += eigen.eigenvectors().col(i) * (along / value);
  }
  out.theta = scale.cwiseProduct(theta);
  // Bounds: clearly on the wrong side of one makes it something else.
  for (Index i = 0; i < p; ++i) {
    const double bound = lower[static_cast<std::size_t>(i)];
    if (bound < no_bound || out.theta[i] >= bound) continue;
    const double std = scale[i] / std::sqrt(std::max(g(i, i), 1e-12));
    if (out.theta[i] < bound - beyond * std) out.square = 0;
  }
  return out;
}

bool is_share(const Group& group) { return !group.in_model && find_effect(group.candidate.effect)->share; }

}  // namespace fxdyn::diagnosis
