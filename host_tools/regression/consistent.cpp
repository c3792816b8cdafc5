#include "host_tools/regression/consistent.hpp"

#include <cmath>

#include "host_tools/regression/pseudo_inertia.hpp"
#include "host_tools/regression/solver.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr auto ten = static_cast<Index>(parameters_per_link);
/// Weight of the prior at the end, of one row of the data: with it the prior's standard deviations are about as large
/// as its values (see DataShare). Far less would let bodies that the data hardly sees grow to any mass.
constexpr double final_weight = 1;
/// Distance that a body keeps from the impossible, of the prior: far below what any data resolves, far above rounding.
constexpr double margin = 1e-11;
constexpr double unbounded_theta = 1e29;
/// The prior's bodies are as good as unlimited in size until the end: a path from a small prior to a large body would
/// creep along the edge of what is possible.
constexpr double pull_on_the_way = 1e-3;
/// A coefficient that is zero comes out within this root of its standard deviation.
constexpr double edge_at_the_end = 1e-4;
/// Share of the way to the edge of what is possible that a step may go.
constexpr double share_of_way = 0.5;

/// Variables of the Newton steps: y = [beta; the other standard parameters; rotors; theta].
class Path {
 public:
  explicit Path(const ConsistentProblem& problem) : p_(problem) {
    const Index nb = static_cast<Index>(p_.columns.size());
    rotors_ = p_.rotor_prior.size();
    const Index all = p_.grouping.cols() + rotors_;
    MatrixXd grouping(nb, all);
    grouping << p_.grouping, p_.rotors.reshaped(nb, rotors_);
    std::vector<bool> is_base(static_cast<std::size_t>(all), false);
    for (const Index c : p_.columns) is_base[static_cast<std::size_t>(c)] = true;
    for (Index c = 0; c < all; ++c) {
      if (!is_base[static_cast<std::size_t>(c)]) others_.push_back(c);
    }
    base_ = nb;
    masses_ = all;
    thetas_ = p_.information.rows() - nb;
    // pi = map * [beta; others]
    map_ = MatrixXd::Zero(all, all);
    for (Index i = 0; i < nb; ++i) map_(p_.columns[static_cast<std::size_t>(i)], i) = 1;
    for (std::size_t i = 0; i < others_.size(); ++i) {
      const Index at = nb + static_cast<Index>(i);
      map_(others_[i], at) = 1;
      for (Index b = 0; b < nb; ++b) map_(p_.columns[static_cast<std::size_t>(b)], at) = -grouping(b, others_[i]);
    }
    for (const Matrix4d& prior : p_.prior) {
      prior_inverse_.push_back(prior.inverse());
    }
    target_ = SymmetricSolver(p_.information).solve(p_.projection);
    // where the bodies start, so do the parameters of y
    VectorXd pi(all);
    for (std::size_t i = 0; i < p_.prior.size(); ++i)
      pi.segment(static_cast<Index>(i) * ten, ten) = pseudo_inertia_parameters(p_.prior[i]);
    pi.tail(rotors_) = p_.rotor_prior;
    y_.resize(all + thetas_);
    y_.head(nb) = grouping * pi;
    for (std::size_t i = 0; i < others_.size(); ++i) y_[nb + static_cast<Index>(i)] = pi[others_[i]];
    for (Index i = 0; i < thetas_; ++i) {
      const double information = p_.information(nb + i, nb + i);
      const double spread = information > 0 ? std::sqrt(p_.variance / information) : 1;
      const double wish = target_[nb + i];
      double start = wish;
      if (has_lower(i)) start = std::max(start, p_.lower[i] + std::max(spread, std::fabs(wish - p_.lower[i])));
      if (has_upper(i)) start = std::min(start, p_.upper[i] - std::max(spread, std::fabs(wish - p_.upper[i])));
      if (has_lower(i) && has_upper(i) && !(start > p_.lower[i] && start < p_.upper[i]))
        start = (p_.lower[i] + p_.upper[i]) / 2;
      y_[all + i] = start;
    }
  }

  ConsistentFit run() {
    const double start = excess(y_) / static_cast<double>(4 * p_.prior.size() + static_cast<std::size_t>(rotors_));
    const double end = final_weight * p_.variance;
    for (double weight = std::max(start, end);; weight = std::max(end, weight * 0.2)) {
      centre(weight, 50, 1e-2);
      if (weight <= end) break;
    }
    pull_ = 1;
    edge_ = edge_at_the_end;
    centre(end, 200, 1e-12);
    ConsistentFit fit;
    fit.constrained = !reach_target();
    fit.beta = fit.constrained ? y_.head(base_) : target_.head(base_);
    fit.theta = fit.constrained ? y_.tail(thetas_) : target_.tail(thetas_);
    fit.bodies = matrices(y_);
    fit.rotors = rotors(y_);
    fit.excess = fit.constrained ? excess(y_) / p_.variance : 0;
    return fit;
  }

 private:
  bool has_lower(Index i) const { return p_.lower[i] > -unbounded_theta; }
  bool has_upper(Index i) const { return p_.upper[i] < unbounded_theta; }

  std::vector<Matrix4d> matrices(const VectorXd& y) const {
    const VectorXd pi = map_ * y.head(masses_);
    std::vector<Matrix4d> out;
    for (Index i = 0; i < masses_ - rotors_; i += ten) out.push_back(pseudo_inertia(pi.segment(i, ten)));
    return out;
  }
  /// None of them is among the base columns.
  VectorXd rotors(const VectorXd& y) const { return y.segment(masses_ - rotors_, rotors_); }
  VectorXd deviation(const VectorXd& y) const {
    VectorXd z(base_ + thetas_);
    z << y.head(base_), y.tail(thetas_);
    return z - target_;
  }
  /// Half of the squared error beyond the least squares solution's.
  double excess(const VectorXd& y) const {
    const VectorXd d = deviation(y);
    return 0.5 * d.dot(p_.information * d);
  }
  /// Divergence from the prior (but for constants); infinite outside.
  double barrier_of_bodies(const VectorXd& y) const {
    double sum = 0;
    const auto bodies = matrices(y);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const Eigen::LLT<Matrix4d> llt(bodies[i] - margin * p_.prior[i]);
      if (llt.info() != Eigen::Success) return INFINITY;
      sum += pull_ * (prior_inverse_[i] * bodies[i]).trace();
      for (int k = 0; k < 4; ++k) sum -= 2 * std::log(llt.matrixLLT()(k, k));
    }
    const VectorXd ratios = rotors(y).cwiseQuotient(p_.rotor_prior);
    for (const double ratio : ratios) {
      if (ratio <= margin) return INFINITY;
      sum += pull_ * ratio - std::log(ratio - margin);
    }
    return sum;
  }
  /// The same with barriers of theta.
  double barrier(const VectorXd& y) const {
    double sum = barrier_of_bodies(y);
    for (Index i = 0; i < thetas_; ++i) {
      const double value = y[masses_ + i];
      if ((has_lower(i) && value <= p_.lower[i]) || (has_upper(i) && value >= p_.upper[i])) return INFINITY;
      if (has_lower(i)) sum -= edge_ * std::log(value - p_.lower[i]);
      if (has_upper(i)) sum -= edge_ * std::log(p_.upper[i] - value);
    }
    return sum;
  }

  /// Gradient and Hessian of the barrier.
  void derivatives(const VectorXd& y, VectorXd& gradient, MatrixXd& hessian) const {
    VectorXd of_pi(masses_);
    MatrixXd map = map_;  // becomes blockdiag(Hessians) * map
    const auto bodies = matrices(y);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const Index at = static_cast<Index>(i) * ten;
      const Matrix4d inverse = (bodies[i] - margin * p_.prior[i]).inverse();
      of_pi.segment(at, ten) = inner_products(pull_ * prior_inverse_[i] - inverse);
      map.middleRows(at, ten) = barrier_hessian(inverse) * map_.middleRows(at, ten);
    }
    const VectorXd inertias = rotors(y);
    for (Index i = 0; i < rotors_; ++i) {
      const Index at = masses_ - rotors_ + i;
      const double inside = inertias[i] - margin * p_.rotor_prior[i];
      of_pi[at] = pull_ / p_.rotor_prior[i] - 1 / inside;
      map.row(at) /= inside * inside;
    }
    gradient.setZero(y.size());
    hessian.setZero(y.size(), y.size());
    gradient.head(masses_) = map_.transpose() * of_pi;
    hessian.topLeftCorner(masses_, masses_) = map_.transpose() * map;
    for (Index i = 0; i < thetas_; ++i) {
      const Index k = masses_ + i;
      for (const double distance :
           {has_lower(i) ? y[k] - p_.lower[i] : INFINITY, has_upper(i) ? y[k] - p_.upper[i] : -INFINITY}) {
        gradient[k] -= edge_ / distance;
        hessian(k, k) += edge_ / (distance * distance);
      }
    }
  }

  /// Largest step that stays inside, at most 1.
  double longest(const VectorXd& step) const {
    double t = 1 / share_of_way;
    const auto bodies = matrices(y_), moves = matrices(step);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix4d> solver(moves[i], bodies[i] - margin * p_.prior[i],
                                                                      Eigen::EigenvaluesOnly);
      const double lowest = solver.eigenvalues().minCoeff();
      if (lowest < 0) t = std::min(t, -1 / lowest);
    }
    const VectorXd inertias = rotors(y_), changes = rotors(step);
    for (Index i = 0; i < rotors_; ++i) {
      if (changes[i] < 0) t = std::min(t, (margin * p_.rotor_prior[i] - inertias[i]) / changes[i]);
    }
    for (Index i = 0; i < thetas_; ++i) {
      const double d = step[masses_ + i], value = y_[masses_ + i];
      if (has_lower(i) && d < 0) t = std::min(t, (p_.lower[i] - value) / d);
      if (has_upper(i) && d > 0) t = std::min(t, (p_.upper[i] - value) / d);
    }
    return std::min(1.0, share_of_way * t);
  }

  /// Newton to the minimum of the error + weight * barrier.
  void centre(double weight, int rounds, double enough) {
    VectorXd gradient;
    MatrixXd hessian;
    for (int round = 0; round < rounds; ++round) {
      derivatives(y_, gradient, hessian);
      const VectorXd pull = p_.information * deviation(y_) / weight;
      gradient.head(base_) += pull.head(base_);
      gradient.tail(thetas_) += pull.tail(thetas_);
      hessian.topLeftCorner(base_, base_) += p_.information.topLeftCorner(base_, base_) / weight;
      hessian.topRightCorner(base_, thetas_) += p_.information.topRightCorner(base_, thetas_) / weight;
      hessian.bottomLeftCorner(thetas_, base_) += p_.information.bottomLeftCorner(thetas_, base_) / weight;
      hessian.bottomRightCorner(thetas_, thetas_) += p_.information.bottomRightCorner(thetas_, thetas_) / weight;
      const VectorXd step = -SymmetricSolver(hessian).solve(gradient);
      const double decrement = -gradient.dot(step);
      if (!(decrement > enough)) return;
      const double before = excess(y_) / weight + barrier(y_);
      double t = longest(step);
      const auto after = [&] { return excess(y_ + t * step) / weight + barrier(y_ + t * step); };
      while (t > 1e-8 && !(after() <= before - 0.1 * t * decrement)) t /= 2;
      // Rounding ends the search where the decrement can't: nothing is left to gain.
      if (t <= 1e-8) return;
      y_ += t * step;
    }
  }

  /// Moves to the least squares solution if bodies for it are found close to the path, and settles on those closest to
  /// the prior. Otherwise leaves everything as it is.
  bool reach_target() {
    for (Index i = 0; i < thetas_; ++i) {
      const double value = target_[base_ + i];
      if ((has_lower(i) && value < p_.lower[i]) || (has_upper(i) && value > p_.upper[i])) return false;
    }
    const VectorXd kept = y_;
    const Index free = masses_ - base_;
    VectorXd gradient;
    MatrixXd hessian;
    bool there = false;
    y_.tail(thetas_) = target_.tail(thetas_);
    for (int round = 0; round < 100; ++round) {
      derivatives(y_, gradient, hessian);
      VectorXd step = VectorXd::Zero(y_.size());
      if (!there) step.head(base_) = target_.head(base_) - y_.head(base_);
      if (free > 0) {
        const VectorXd slope = gradient.segment(base_, free) + hessian.block(base_, 0, free, base_) * step.head(base_);
        step.segment(base_, free) = -SymmetricSolver(hessian.block(base_, base_, free, free)).solve(slope);
        if (there && -slope.dot(step.segment(base_, free)) < 1e-12) break;
      } else if (there) {
        break;
      }
      double t = longest(step);
      if (there) {
        const double before = barrier_of_bodies(y_), slope = gradient.head(masses_).dot(step.head(masses_));
        while (t > 1e-8 && !(barrier_of_bodies(y_ + t * step) <= before + 0.1 * t * slope)) t /= 2;
        if (t <= 1e-8) break;
      }
      y_ += t * step;
      if (!there && t == 1) {
        there = true;
        y_.head(base_) = target_.head(base_);
      }
      if (!there && round > 40) break;
    }
    if (there && std::isfinite(barrier_of_bodies(y_))) return true;
    y_ = kept;
    return false;
  }
  const ConsistentProblem& p_;
  double pull_ = pull_on_the_way;  ///< factor of tr(P0^-1 P)
  double edge_ = 1;                ///< factor of theta's barriers
  Index base_ = 0, masses_ = 0, rotors_ = 0, thetas_ = 0;
  std::vector<Index> others_;
  MatrixXd map_;
  std::vector<Matrix4d> prior_inverse_;
  VectorXd target_, y_;
};

}  // namespace

ConsistentFit fit_consistent(const ConsistentProblem& problem) { return Path(problem).run(); }

}  // namespace fxdyn
