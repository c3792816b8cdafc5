#pragma once

#include <Eigen/Dense>
#include <optional>
#include <utility>

namespace fxdyn {

/// Rules of gauss_newton().
struct GaussNewton {
  int most_rounds = 15;
  double shrink = 0.4;      ///< a step that is not accepted is tried again times this
  double shortest = 0.05;   ///< share of the full step from which on it is given up
  double tolerance = 0;     ///< an accepted step that moves no unknown by as much is the last one
  Eigen::VectorXd lower{};  ///< bounds of the unknowns; empty: none
  Eigen::VectorXd upper{};
};

/// Damped Gauss-Newton over the nonlinear unknowns of separable least squares (Golub, Pereyra 1973): the linear ones
/// are solved anew wherever a step leads.
/// @param step (x, round) -> std::optional<VectorXd>: the full step from x; nothing: it ends at x
/// @param accept (x, round) -> bool: whether x is better than the last one that was accepted; keeps what it is about
template <class Step, class Accept>
Eigen::VectorXd gauss_newton(Eigen::VectorXd x, const GaussNewton& rules, Step&& step, Accept&& accept) {
  for (int round = 0; round < rules.most_rounds; ++round) {
    const std::optional<Eigen::VectorXd> full = step(std::as_const(x), round);
    if (!full) break;
    bool accepted = false;
    double moved = 0;
    for (double share = 1; share > rules.shortest && !accepted; share *= rules.shrink) {
      Eigen::VectorXd next = x + share * *full;
      if (rules.lower.size() > 0) next = next.cwiseMax(rules.lower);
      if (rules.upper.size() > 0) next = next.cwiseMin(rules.upper);
      accepted = accept(std::as_const(next), round);
      if (!accepted) continue;
      moved = (next - x).cwiseAbs().maxCoeff();
      x = std::move(next);
    }
    if (!accepted || moved < rules.tolerance) break;
  }
  return x;
}

}  // namespace fxdyn
