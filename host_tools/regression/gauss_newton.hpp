#pragma once

#include <Eigen/Dense>
#include <optional>
#include <utility>

namespace fxdyn {

/// Rules of gauss_newton().
struct GaussNewton {
  int most_rounds = 15;     ///< full steps
  int most_tries = 4;       ///< of one step, each shorter than the one before
  double shrink = 0.4;      ///< a step that is rejected is tried again times this
  double tolerance = 0;     ///< an accepted step that moves no unknown by as much is the last one
  Eigen::VectorXd lower{};  ///< bounds of the unknowns; empty: none
  Eigen::VectorXd upper{};
};

/// What a trial step is worth.
enum class Trial {
  rejected,   ///< a shorter one is tried
  accepted,   ///< the next step begins where it leads
  converged,  ///< accepted, and the last one
  given_up,   ///< rejected, and no shorter one is worth a try
};

/// Damped Gauss-Newton over the nonlinear unknowns of separable least squares (Golub, Pereyra 1973): the linear ones
/// are solved anew wherever a step leads. The unknowns may be any type that can be moved.
/// @param step (x, round) -> std::optional of anything: the full step from x; nothing: it ends at x
/// @param move (x, full step, share) -> where that share of the step leads. It may as well damp the step otherwise:
/// by a share for each group of unknowns, or as Levenberg and Marquardt do.
/// @param accept (x, next, round) -> Trial; keeps what it is about. It may take back parts of an accepted `next`.
template <class State, class Step, class Move, class Accept>
State gauss_newton(State x, const GaussNewton& rules, Step&& step, Move&& move, Accept&& accept) {
  for (int round = 0; round < rules.most_rounds; ++round) {
    const auto full = step(std::as_const(x), round);
    if (!full) break;
    Trial trial = Trial::rejected;
    double share = 1;
    for (int tried = 0; tried < rules.most_tries && trial == Trial::rejected; ++tried, share *= rules.shrink) {
      State next = move(std::as_const(x), *full, share);
      trial = accept(std::as_const(x), next, round);
      if (trial == Trial::accepted || trial == Trial::converged) x = std::move(next);
    }
    if (trial != Trial::accepted) break;
  }
  return x;
}

/// The same over a vector of unknowns, straight along the step and within the bounds.
/// @param accept (next, round) -> bool: whether it is better than the last one that was accepted
template <class Step, class Accept>
Eigen::VectorXd gauss_newton(Eigen::VectorXd x, const GaussNewton& rules, Step&& step, Accept&& accept) {
  const auto move = [&](const Eigen::VectorXd& from, const Eigen::VectorXd& full, double share) {
    Eigen::VectorXd next = from + share * full;
    if (rules.lower.size() > 0) next = next.cwiseMax(rules.lower);
    if (rules.upper.size() > 0) next = next.cwiseMin(rules.upper);
    return next;
  };
  const auto judge = [&](const Eigen::VectorXd& from, const Eigen::VectorXd& next, int round) {
    if (!accept(next, round)) return Trial::rejected;
    return (next - from).cwiseAbs().maxCoeff() < rules.tolerance ? Trial::converged : Trial::accepted;
  };
  return gauss_newton(std::move(x), rules, step, move, judge);
}

}  // namespace fxdyn
