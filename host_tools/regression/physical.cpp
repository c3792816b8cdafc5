#include "host_tools/regression/physical.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "host_tools/effects/effects.hpp"
#include "host_tools/regression/consistent.hpp"
#include "host_tools/regression/pseudo_inertia.hpp"
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
/// nats; what rotors must bring beyond bodies alone; hand: log 1000, as for a name beside another
constexpr double rotors_bring = 6.9;

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
    const Inertial body = given ? possible_body(*given) : ellipsoid(problem.robot, i);
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
    (is_generic ? scaled : fixed).segment(static_cast<Index>(i) * ten, ten) =
        pseudo_inertia_parameters(prior.bodies[i]);
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

/// Rotors that the base parameters absorb. Prior: as much inertia as the prior's bodies have about the joint at its
/// zero.
struct Rotors {
  std::vector<Index> joints;
  MatrixXd in_base;
  VectorXd prior;
};
Rotors absorbed_rotors(const PhysicalProblem& problem, const std::vector<Matrix4d>& bodies) {
  const auto n = static_cast<Index>(problem.robot.size());
  VectorXd pi(n * ten);
  for (std::size_t i = 0; i < bodies.size(); ++i)
    pi.segment(static_cast<Index>(i) * ten, ten) = pseudo_inertia_parameters(bodies[i]);
  Regressor regressor(problem.chain);
  const VectorXd zero = VectorXd::Zero(n);
  Rotors out;
  std::vector<VectorXd> in_base;
  std::vector<double> prior;
  for (Index j = 0; j < n; ++j) {
    VectorXd column = rotor_in_base(problem.chain, problem.base, j);
    if (column.size() == 0) continue;
    const double moved = regressor(zero, zero, VectorXd::Unit(n, j)).row(j) * pi;
    const double held = regressor(zero, zero, zero).row(j) * pi;
    out.joints.push_back(j);
    in_base.push_back(std::move(column));
    prior.push_back(moved - held);
  }
  out.in_base.resize(static_cast<Index>(problem.base.columns.size()), static_cast<Index>(in_base.size()));
  for (std::size_t i = 0; i < in_base.size(); ++i) out.in_base.col(static_cast<Index>(i)) = in_base[i];
  out.prior = Eigen::Map<const VectorXd>(prior.data(), static_cast<Index>(prior.size()));
  return out;
}

/// Fills in what the data decided. Rotors: those of the fit; none, where it has none.
void add_shares(const PhysicalProblem& problem, const Reduced& data, const std::vector<Matrix4d>& prior,
                const Rotors& rotors, PhysicalFit& fit) {
  const Index of_bodies = problem.base.grouping.cols(), all = of_bodies + rotors.prior.size();
  MatrixXd before = MatrixXd::Zero(all, all);  // covariance of the prior
  for (std::size_t i = 0; i < prior.size(); ++i) {
    const Index at = static_cast<Index>(i) * ten;
    before.block(at, at, ten, ten) = barrier_hessian(prior[i].inverse()).inverse();
  }
  before.diagonal().tail(rotors.prior.size()) = rotors.prior.cwiseAbs2();
  MatrixXd grouping(problem.base.grouping.rows(), all);
  grouping << problem.base.grouping, rotors.in_base;
  // information = root^T root, S = root G: covariance after = before - (S before)^T (1 + S before S^T)^-1 (S before)
  MatrixXd from_logs = data.information / problem.variance;
  if (problem.known.size() > 0) from_logs -= problem.known;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(from_logs);
  const MatrixXd seen =
      solver.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() * solver.eigenvectors().transpose() * grouping;
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

PhysicalFit fit_physical(const PhysicalProblem& problem) {
  const Reduced data = without_theta(problem);
  const Prior prior = make_prior(problem, data);
  const ConsistentProblem bodies{problem.information,   problem.projection,   problem.lower, problem.upper,
                                 problem.base.grouping, problem.base.columns, prior.bodies,  problem.variance};
  ConsistentFit consistent = fit_consistent(bodies);
  PhysicalFit fit;
  fit.rotor = VectorXd::Zero(static_cast<Index>(problem.robot.size()));
  Rotors used{{}, MatrixXd(problem.base.grouping.rows(), 0), {}};
  if (consistent.constrained) {
    Rotors rotors = absorbed_rotors(problem, prior.bodies);
    ConsistentProblem more = bodies;
    more.rotors = rotors.in_base;
    more.rotor_prior = rotors.prior;
    ConsistentFit with_rotors = fit_consistent(more);
    if (with_rotors.excess < consistent.excess - rotors_bring) {
      consistent = std::move(with_rotors);
      used = std::move(rotors);
      for (std::size_t i = 0; i < used.joints.size(); ++i)
        fit.rotor[used.joints[i]] = consistent.rotors[static_cast<Index>(i)];
    }
  }
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
  add_shares(problem, data, prior.bodies, used, fit);
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
  return fit_physical({robot, chain, fitter.base(), std::move(information), std::move(projection), lower, upper,
                       variance, fitter.prior().information / variance});
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

std::vector<std::string> share_comments(const PhysicalFit& fit) {
  std::vector<std::string> out;
  for (const DataShare& share : fit.share) {
    out.push_back(fmt::format(
        "data_share mass {:.2f}, centre {:.2f} {:.2f} {:.2f}, first moment {:.2f} {:.2f} {:.2f}: from {:.2f} on the "
        "logs determined it, 0 is the prior ({})",
        share.mass, share.centre.x(), share.centre.y(), share.centre.z(), share.first_moment.x(),
        share.first_moment.y(), share.first_moment.z(), determined_share, fit.prior));
    if (const double rotor = fit.rotor[static_cast<Index>(out.size()) - 1]; rotor > 0)
      out.back() += fmt::format("; beside it the joint's rotor with {:.3g} kg*m^2 (slides: kg), reflected", rotor);
  }
  return out;
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

}  // namespace fxdyn
