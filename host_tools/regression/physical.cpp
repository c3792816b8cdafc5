#include "host_tools/regression/physical.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/regression/solver.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr auto ten = static_cast<Index>(parameters_per_link);
/// Weight of the prior at the end, of one row of the data: with it the prior's standard deviations are about as large
/// as its values (see DataShare). Far less would let bodies that the data hardly sees grow to any mass.
constexpr double final_weight = 1;
/// Distance that a body keeps from the impossible, of the prior: far below what any data tells, far above rounding.
constexpr double margin = 1e-11;
constexpr double unbounded_theta = 1e29;
/// The prior's bodies are as good as unlimited in size until the end: a path from a small prior to a large body would
/// creep along the edge of what is possible.
constexpr double pull_on_the_way = 1e-3;
/// A coefficient that is zero comes out within this root of its standard deviation.
constexpr double edge_at_the_end = 1e-4;
/// Share of the way to the edge of what is possible that a step may go.
constexpr double share_of_way = 0.5;

/// The position of each parameter in the upper triangle of P.
constexpr std::array<std::array<int, 2>, 10> places{
    {{3, 3}, {0, 3}, {1, 3}, {2, 3}, {0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};

Matrix4d to_matrix(const Eigen::Ref<const VectorXd>& body) {
  Matrix4d p;
  for (Index k = 0; k < ten; ++k) {
    const auto [r, c] = places[static_cast<std::size_t>(k)];
    p(r, c) = p(c, r) = body[k];
  }
  return p;
}

VectorXd to_vector(const Matrix4d& p) {
  VectorXd body(ten);
  for (Index k = 0; k < ten; ++k) {
    const auto [r, c] = places[static_cast<std::size_t>(k)];
    body[k] = p(r, c);
  }
  return body;
}

/// <M, dP/dpi_k> for all k.
VectorXd inner(const Matrix4d& m) {
  VectorXd out(ten);
  for (Index k = 0; k < ten; ++k) {
    const auto [r, c] = places[static_cast<std::size_t>(k)];
    out[k] = r == c ? m(r, c) : 2 * m(r, c);
  }
  return out;
}

/// tr(M dP_k M dP_l), the Hessian of -log det P for M = P^-1.
MatrixXd barrier_hessian(const Matrix4d& m) {
  MatrixXd out(ten, ten);
  for (Index k = 0; k < ten; ++k) {
    const auto [r, c] = places[static_cast<std::size_t>(k)];
    Matrix4d product = m.col(r) * m.row(c);
    if (r != c) product += m.col(c) * m.row(r);
    out.row(k) = inner((product + product.transpose()) / 2).transpose();
  }
  return out;
}

/// Variables of the Newton steps: y = [beta; the other standard parameters; theta].
class Path {
 public:
  explicit Path(const ConsistentProblem& problem) : p_(problem) {
    const Index nb = static_cast<Index>(p_.columns.size()), all = p_.grouping.cols();
    std::vector<bool> is_base(static_cast<std::size_t>(all), false);
    for (const Index c : p_.columns) is_base[static_cast<std::size_t>(c)] = true;
    for (Index c = 0; c < all; ++c) {
      if (!is_base[static_cast<std::size_t>(c)]) others_.push_back(c);
    }
    base_ = nb;
    bodies_ = all;
    thetas_ = p_.information.rows() - nb;
    // pi = map * [beta; others]
    map_ = MatrixXd::Zero(all, all);
    for (Index i = 0; i < nb; ++i) map_(p_.columns[static_cast<std::size_t>(i)], i) = 1;
    for (std::size_t i = 0; i < others_.size(); ++i) {
      const Index at = nb + static_cast<Index>(i);
      map_(others_[i], at) = 1;
      for (Index b = 0; b < nb; ++b) map_(p_.columns[static_cast<std::size_t>(b)], at) = -p_.grouping(b, others_[i]);
    }
    for (const Matrix4d& prior : p_.prior) {
      prior_inverse_.push_back(prior.inverse());
    }
    target_ = SymmetricSolver(p_.information).solve(p_.projection);
    // where the bodies start, so do the parameters of y
    VectorXd pi(all);
    for (std::size_t i = 0; i < p_.prior.size(); ++i)
      pi.segment(static_cast<Index>(i) * ten, ten) = to_vector(p_.prior[i]);
    y_.resize(all + thetas_);
    y_.head(nb) = p_.grouping * pi;
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
    const double start = excess(y_) / (4.0 * static_cast<double>(p_.prior.size()));
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
    return fit;
  }

 private:
  bool has_lower(Index i) const { return p_.lower[i] > -unbounded_theta; }
  bool has_upper(Index i) const { return p_.upper[i] < unbounded_theta; }

  std::vector<Matrix4d> matrices(const VectorXd& y) const {
    const VectorXd pi = map_ * y.head(bodies_);
    std::vector<Matrix4d> out;
    for (Index i = 0; i < bodies_; i += ten) out.push_back(to_matrix(pi.segment(i, ten)));
    return out;
  }
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
    return sum;
  }
  /// The same with barriers of theta.
  double barrier(const VectorXd& y) const {
    double sum = barrier_of_bodies(y);
    for (Index i = 0; i < thetas_; ++i) {
      const double value = y[bodies_ + i];
      if ((has_lower(i) && value <= p_.lower[i]) || (has_upper(i) && value >= p_.upper[i])) return INFINITY;
      if (has_lower(i)) sum -= edge_ * std::log(value - p_.lower[i]);
      if (has_upper(i)) sum -= edge_ * std::log(p_.upper[i] - value);
    }
    return sum;
  }

  /// Gradient and Hessian of the barrier.
  void derivatives(const VectorXd& y, VectorXd& gradient, MatrixXd& hessian) const {
    VectorXd of_pi(bodies_);
    MatrixXd map = map_;  // becomes blockdiag(Hessians) * map
    const auto bodies = matrices(y);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const Index at = static_cast<Index>(i) * ten;
      const Matrix4d inverse = (bodies[i] - margin * p_.prior[i]).inverse();
      of_pi.segment(at, ten) = inner(pull_ * prior_inverse_[i] - inverse);
      map.middleRows(at, ten) = barrier_hessian(inverse) * map_.middleRows(at, ten);
    }
    gradient.setZero(y.size());
    hessian.setZero(y.size(), y.size());
    gradient.head(bodies_) = map_.transpose() * of_pi;
    hessian.topLeftCorner(bodies_, bodies_) = map_.transpose() * map;
    for (Index i = 0; i < thetas_; ++i) {
      const Index k = bodies_ + i;
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
    for (Index i = 0; i < thetas_; ++i) {
      const double d = step[bodies_ + i], value = y_[bodies_ + i];
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
    const Index free = bodies_ - base_;
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
        const double before = barrier_of_bodies(y_), slope = gradient.head(bodies_).dot(step.head(bodies_));
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
  Index base_ = 0, bodies_ = 0, thetas_ = 0;
  std::vector<Index> others_;
  MatrixXd map_;
  std::vector<Matrix4d> prior_inverse_;
  VectorXd target_, y_;
};

/// A solid ellipsoid of density 1000 kg/m^3 around the segment from a link's joint to the next one, in its URDF frame.
Inertial ellipsoid(const Robot& robot, std::size_t link) {
  double reach = 0;
  for (std::size_t i = 1; i < robot.size(); ++i) reach += robot.joints[i].origin.translation().norm();
  const Vector3d segment =
      link + 1 < robot.size() ? Vector3d(robot.joints[link + 1].origin.translation()) : Vector3d::Zero();
  const double length = segment.norm();
  const double mean = reach > 0 ? reach / static_cast<double>(robot.size()) : 0.3;
  const double across = std::max(0.25 * length, 0.3 * mean), along = std::max(0.5 * length, across);
  Inertial body;
  body.mass = 1000 * 4.0 / 3 * std::numbers::pi * along * across * across;
  body.centre = segment / 2;
  const Vector3d axis = length > 0 ? Vector3d(segment / length) : Vector3d::UnitZ();
  const Matrix3d second =
      body.mass / 5 *
      (across * across * Matrix3d::Identity() + (along * along - across * across) * axis * axis.transpose());
  body.tensor = second.trace() * Matrix3d::Identity() - second;
  return body;
}

/// The body with second moments about its centre that are safely positive: URDFs have points, rods and rounded tensors.
Inertial made_possible(const Inertial& body) {
  const Matrix3d second = 0.5 * body.tensor.trace() * Matrix3d::Identity() - body.tensor;
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(second);
  constexpr double smallest = 2e-3;  // radius of gyration [m]
  const double floor = std::max(1e-3 * second.trace(), body.mass * smallest * smallest);
  if (solver.eigenvalues().minCoeff() >= floor) return body;
  const Matrix3d raised =
      solver.eigenvectors() * solver.eigenvalues().cwiseMax(floor).asDiagonal() * solver.eigenvectors().transpose();
  Inertial out = body;
  out.tensor = raised.trace() * Matrix3d::Identity() - raised;
  return out;
}

/// Information about beta alone: theta's share taken out.
struct Reduced {
  MatrixXd information;
  VectorXd projection;
};
Reduced without_theta(const PhysicalProblem& problem) {
  const auto nb = static_cast<Index>(problem.base.columns.size());
  const Index m = problem.information.rows() - nb;
  Reduced out{problem.information.topLeftCorner(nb, nb), problem.projection.head(nb)};
  if (m == 0) return out;
  const MatrixXd across = problem.information.bottomLeftCorner(m, nb);
  const MatrixXd own = problem.information.bottomRightCorner(m, m);
  const SymmetricSolver nuisance(own);
  for (Index i = 0; i < nb; ++i) out.information.col(i) -= across.transpose() * nuisance.solve(across.col(i));
  out.information = ((out.information + out.information.transpose()) / 2).eval();
  out.projection -= across.transpose() * nuisance.solve(problem.projection.tail(m));
  return out;
}

struct Prior {
  std::vector<Matrix4d> bodies;
  std::string text;
};
Prior make_prior(const PhysicalProblem& problem, const Reduced& data) {
  Prior prior;
  std::vector<std::size_t> generic;
  for (std::size_t i = 0; i < problem.robot.size(); ++i) {
    const auto& given = problem.robot.joints[i].inertial;
    if (!given) generic.push_back(i);
    const Inertial body = given ? made_possible(*given) : ellipsoid(problem.robot, i);
    prior.bodies.push_back(pseudo_inertia(to_link_inertia(body, problem.chain.urdf_in_dh[i])));
  }
  if (generic.empty()) {
    prior.text = "inertias of the URDF";
    return prior;
  }
  // The one density that fits best beside what the URDF gives.
  VectorXd fixed = VectorXd::Zero(problem.base.grouping.cols()), scaled = fixed;
  for (std::size_t i = 0; i < problem.robot.size(); ++i) {
    const bool is_generic = !problem.robot.joints[i].inertial;
    (is_generic ? scaled : fixed).segment(static_cast<Index>(i) * ten, ten) = to_vector(prior.bodies[i]);
  }
  const VectorXd u = problem.base.grouping * scaled;
  const VectorXd rest = data.projection - data.information * (problem.base.grouping * fixed);
  const double squares = u.dot(data.information * u);
  double density = squares > 0 ? u.dot(rest) / squares : 1;
  if (!(density > 1e-4)) density = 1;
  density = std::min(density, 1e4);
  for (const std::size_t i : generic) prior.bodies[i] *= density;
  prior.text =
      fmt::format("{}solid ellipsoids around the segments between joints, {:.3g} kg/m^3 (fits the data best)",
                  generic.size() < problem.robot.size() ? "inertias of the URDF; links without: " : "", 1000 * density);
  return prior;
}

/// Fills in what the data decided.
void add_shares(const PhysicalProblem& problem, const Reduced& data, const std::vector<Matrix4d>& prior,
                PhysicalFit& fit) {
  const Index all = problem.base.grouping.cols();
  MatrixXd before = MatrixXd::Zero(all, all);  // covariance of the prior
  for (std::size_t i = 0; i < prior.size(); ++i) {
    const Index at = static_cast<Index>(i) * ten;
    before.block(at, at, ten, ten) = barrier_hessian(prior[i].inverse()).inverse();
  }
  // information = root^T root, S = root G: covariance after = before - (S before)^T (1 + S before S^T)^-1 (S before)
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(data.information / problem.variance);
  const MatrixXd seen = solver.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() * solver.eigenvectors().transpose() *
                        problem.base.grouping;
  const MatrixXd seen_before = seen * before;
  const Eigen::LLT<MatrixXd> llt(MatrixXd::Identity(seen.rows(), seen.rows()) + seen_before * seen.transpose());
  const auto share = [&](const VectorXd& direction) {
    const double taken = llt.matrixL().solve(seen_before * direction).squaredNorm();
    return std::clamp(taken / direction.dot(before * direction), 0.0, 1.0);
  };
  fit.share.resize(prior.size());
  VectorXd total = VectorXd::Zero(all);
  for (std::size_t i = 0; i < prior.size(); ++i) {
    const Index at = static_cast<Index>(i) * ten;
    total[at] = 1;
    fit.share[i].mass = share(VectorXd::Unit(all, at));
    const LinkInertia<Real>& link = fit.inertia[i];
    const Vector3d centre = Vector3d(link.h.x, link.h.y, link.h.z) / link.m;
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3d u = problem.chain.urdf_in_dh[i].linear().col(axis);
      VectorXd direction = VectorXd::Zero(all);
      direction.segment(at + 1, 3) = u;
      // m c about the URDF frame's origin o is h - m o
      VectorXd moment = direction;
      moment[at] = -u.dot(problem.chain.urdf_in_dh[i].translation());
      fit.share[i].first_moment[axis] = share(moment);
      direction[at] = -u.dot(centre);
      fit.share[i].centre[axis] = share(direction);
    }
  }
  fit.mass_share = share(total);
}

}  // namespace

Matrix4d pseudo_inertia(const LinkInertia<Real>& link) {
  const auto values = to_array(link);
  return to_matrix(Eigen::Map<const VectorXd>(values.data(), ten));
}

LinkInertia<Real> from_pseudo_inertia(const Matrix4d& p) {
  std::array<double, parameters_per_link> values;
  Eigen::Map<VectorXd>(values.data(), ten) = to_vector(p);
  return to_inertia(values);
}

ConsistentFit fit_consistent(const ConsistentProblem& problem) { return Path(problem).run(); }

PhysicalFit fit_physical(const PhysicalProblem& problem) {
  const Reduced data = without_theta(problem);
  const Prior prior = make_prior(problem, data);
  const ConsistentFit consistent =
      fit_consistent({problem.information, problem.projection, problem.lower, problem.upper, problem.base.grouping,
                      problem.base.columns, prior.bodies, problem.variance});
  PhysicalFit fit;
  fit.beta = consistent.beta;
  fit.theta = consistent.theta;
  fit.constrained = consistent.constrained;
  fit.prior = prior.text;
  for (const Matrix4d& body : consistent.bodies) {
    fit.inertia.push_back(from_pseudo_inertia(body));
    fit.smallest_eigenvalue.push_back(
        Eigen::SelfAdjointEigenSolver<Matrix4d>(body, Eigen::EigenvaluesOnly).eigenvalues()[0]);
    fit.mass += body(3, 3);
  }
  add_shares(problem, data, prior.bodies, fit);
  return fit;
}

PhysicalFit fit_physical(const Fitter& fitter, const Robot& robot, double variance) {
  NormalEquations equations = fitter.normal_equations();
  return fit_physical(fitter, robot, std::move(equations.information), std::move(equations.projection), variance);
}

PhysicalFit fit_physical(const Fitter& fitter, const Robot& robot, MatrixXd information, VectorXd projection,
                         double variance) {
  const DhChain chain = to_dh(robot);
  const Index m = information.rows() - static_cast<Index>(fitter.base().columns.size());
  VectorXd lower = VectorXd::Constant(m, -unbounded), upper = -lower;
  Index at = 0;
  for (std::size_t j = 0; j < fitter.joints(); ++j) {
    const JointFit& design = fitter.design(j);
    for (const EffectFit& fit : design.effects) {
      for (const ParameterInfo& parameter : find_effect(fit.effect)->linear) {
        lower[at] = parameter.lower;
        upper[at++] = parameter.upper;
      }
    }
    if (design.bls) at += design.bls->coefficient_count();
  }
  return fit_physical(
      {robot, chain, fitter.base(), std::move(information), std::move(projection), lower, upper, variance});
}

Solution physical_solution(Solution solution, const PhysicalFit& fit) {
  solution.beta = fit.beta;
  Index at = 0;
  for (VectorXd& theta : solution.theta) {
    theta = fit.theta.segment(at, theta.size()).eval();
    at += theta.size();
  }
  return solution;
}

MassCheck mass_check(const Robot& robot, const DhChain& chain, const PhysicalFit& fit) {
  MassCheck check;
  check.mass = fit.mass;
  check.mass_share = fit.mass_share;
  check.urdf_mass = 0;
  for (std::size_t i = 0; i < robot.size(); ++i) {
    const Joint& joint = robot.joints[i];
    check.links.push_back({joint.link, to_inertial(fit.inertia[i], chain.urdf_in_dh[i]), fit.share[i], joint.inertial});
    if (check.urdf_mass && joint.inertial)
      *check.urdf_mass += joint.inertial->mass;
    else
      check.urdf_mass.reset();
  }
  return check;
}

nlohmann::json physical_json(const Robot& robot, const DhChain& chain, const PhysicalFit& fit) {
  using nlohmann::json;
  const MassCheck check = mass_check(robot, chain, fit);
  const auto entry = [](double value, const char* unit, double share) {
    return json{{"value", value}, {"unit", unit}, {"data_share", share}, {"determined", share >= determined_share}};
  };
  json links = json::array();
  for (std::size_t i = 0; i < check.links.size(); ++i) {
    const LinkMass& link = check.links[i];
    const Vector3d moment = link.identified.mass * link.identified.centre;
    json centre = json::array(), first_moment = json::array();
    for (int k = 0; k < 3; ++k) {
      centre.push_back(entry(link.identified.centre[k], "m", link.share.centre[k]));
      first_moment.push_back(entry(moment[k], "kg m", link.share.first_moment[k]));
    }
    links.push_back({{"link", link.link},
                     {"index", i + 1},
                     {"mass", entry(link.identified.mass, "kg", link.share.mass)},
                     {"centre", centre},
                     {"first_moment", first_moment},
                     {"smallest_eigenvalue", fit.smallest_eigenvalue[i]}});
    if (link.urdf) {
      const Vector3d given = link.urdf->mass * link.urdf->centre;
      links.back()["urdf"] = {{"mass", link.urdf->mass},
                              {"centre", std::vector<double>(link.urdf->centre.begin(), link.urdf->centre.end())},
                              {"first_moment", std::vector<double>(given.begin(), given.end())}};
    }
  }
  json out = {{"constrained", fit.constrained},
              {"prior", fit.prior},
              {"mass", entry(check.mass, "kg", check.mass_share)},
              {"links", links}};
  if (check.urdf_mass) out["urdf_mass"] = *check.urdf_mass;
  return out;
}

}  // namespace fxdyn
