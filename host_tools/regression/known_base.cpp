// A joint's own coefficients beside base parameters that are known: what one joint gets changes no other.

#include <cmath>

#include "host_tools/effects/effects.hpp"
#include "host_tools/regression/fitter.hpp"
#include "host_tools/regression/solver.hpp"

namespace fxdyn {
namespace {

/// The least squares solution of A x = b with the first coefficients within their bounds: one that leaves them stays at
/// the bound, the furthest beyond first, and the others are fitted beside it.
Eigen::VectorXd solve_within(const Eigen::MatrixXd& a, const Eigen::VectorXd& b,
                             const std::vector<ParameterInfo>& bounds) {
  const Eigen::Index n = b.size();
  Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
  std::vector<Eigen::Index> free, held;
  for (Eigen::Index i = 0; i < n; ++i) free.push_back(i);
  for (;;) {
    const Eigen::VectorXd rest = b(free) - a(free, held) * x(held);
    x(free) = SymmetricSolver(a(free, free)).solve(rest);
    double furthest = 0;
    std::size_t out = free.size();
    for (std::size_t k = 0; k < free.size() && free[k] < static_cast<Eigen::Index>(bounds.size()); ++k) {
      const ParameterInfo& bound = bounds[static_cast<std::size_t>(free[k])];
      const double beyond = std::max(bound.lower - x[free[k]], x[free[k]] - bound.upper);
      // In units of the torque: coefficients have different ones.
      const double weighed = beyond * std::sqrt(std::max(a(free[k], free[k]), 1e-300));
      if (!(beyond > 0) || weighed <= furthest) continue;
      furthest = weighed;
      out = k;
    }
    if (out == free.size()) return x;
    const ParameterInfo& bound = bounds[static_cast<std::size_t>(free[out])];
    x[free[out]] = x[free[out]] < bound.lower ? bound.lower : bound.upper;
    held.push_back(free[out]);
    free.erase(free.begin() + static_cast<std::ptrdiff_t>(out));
  }
}

std::vector<ParameterInfo> bounds_of(const JointFit& design) {
  std::vector<ParameterInfo> out;
  for (const EffectFit& fit : design.effects) {
    const auto& linear = find_effect(fit.effect)->linear;
    out.insert(out.end(), linear.begin(), linear.end());
  }
  return out;
}

}  // namespace

Solution Fitter::solve_beside(const NormalEquations& equations, const Eigen::VectorXd& beta, bool bounded) const {
  Solution solution;
  solution.beta = beta;
  for (std::size_t j = 0; j < joints(); ++j) {
    const Eigen::Index at = equations.offset[j], own = equations.offset[j + 1] - at;
    const Eigen::VectorXd rest =
        equations.projection.segment(at, own) - equations.information.block(at, 0, own, beta.size()) * beta;
    const std::vector<ParameterInfo> bounds = bounded ? bounds_of(design_[j]) : std::vector<ParameterInfo>();
    solution.theta.push_back(solve_within(equations.information.block(at, at, own, own), rest, bounds));
  }
  return solution;
}

Solution Fitter::estimate_beside(const Eigen::VectorXd& beta, bool bounded) const {
  return solve_beside(normal_equations(), beta, bounded);
}

std::vector<Judgement> Fitter::held_out_beside(const Eigen::VectorXd& beta) const {
  const std::vector<const MomentsByBlock*> all = current();
  const std::vector<const JointFit*> used = designs();
  Tally tally(joints());
  for (std::size_t fold = 0; fold < data_->split.fit.size(); ++fold) {
    const Solution solution = solve_beside(assemble(data_->split.fit[fold], all, used), beta, false);
    for (std::size_t j = 0; j < joints(); ++j) tally.add(j, *this, j, fold, *all[j], *used[j], solution);
  }
  return tally.done(data_->one_recording);
}

}  // namespace fxdyn
