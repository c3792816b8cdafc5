#include "host_tools/regression/physical.hpp"
#include "host_tools/effects/link_parameters.hpp"
#include "host_tools/regression/solver.hpp"

#include <gtest/gtest.h>

#include <chrono>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/random.hpp"
#include "tests/support/chains.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Rows of random motions of a robot with known bodies: the torque of each joint, Coulomb and viscous friction in it.
struct Experiment {
  Robot robot;
  DhChain chain;
  BaseSet base;
  MatrixXd x;  ///< rows x (base + 2 n)
  VectorXd tau, parameters, beta, theta;

  /// @param noise share of the RMS of the torque
  Experiment(const Robot& r, double noise, std::uint64_t seed, Index motions = 200)
      : robot(r), chain(to_dh(r)), base(find_base(chain)) {
    const auto n = static_cast<Index>(robot.size()), nb = static_cast<Index>(base.columns.size());
    parameters.resize(10 * n);
    for (Index i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const auto values = to_array(to_link_inertia(*robot.joints[k].inertial, chain.urdf_in_dh[k]));
      parameters.segment(10 * i, 10) = Eigen::Map<const VectorXd>(values.data(), 10);
    }
    beta = base.grouping * parameters;
    theta = VectorXd::LinSpaced(2 * n, 1, 2);
    Random random(seed);
    Regressor regressor(chain);
    x = MatrixXd::Zero(motions * n, nb + 2 * n);
    for (Index k = 0; k < motions; ++k) {
      VectorXd q(n), dq(n), ddq(n);
      for (Index i = 0; i < n; ++i) {
        q[i] = random.uniform(-2, 2);
        dq[i] = random.normal();
        ddq[i] = 3 * random.normal();
        x(k * n + i, nb + 2 * i) = dq[i] > 0 ? 1 : -1;
        x(k * n + i, nb + 2 * i + 1) = dq[i];
      }
      x.block(k * n, 0, n, nb) = regressor(q, dq, ddq)(Eigen::all, base.columns);
    }
    VectorXd z(nb + 2 * n);
    z << beta, theta;
    tau = x * z;
    const double sigma = noise * tau.norm() / std::sqrt(static_cast<double>(tau.size()));
    for (double& value : tau) value += sigma * random.normal();
  }

  PhysicalProblem problem() const {
    const Index m = theta.size();
    const VectorXd rest = tau - x * SymmetricSolver(x.transpose() * x).solve(x.transpose() * tau);
    // what a fitter's weights allow at most: residuals of 1e-9 of the signal
    const double variance = std::max(rest.squaredNorm(), 1e-18 * tau.squaredNorm()) / static_cast<double>(tau.size());
    return {
        robot,   chain, base, x.transpose() * x, x.transpose() * tau, VectorXd::Zero(m), VectorXd::Constant(m, 1e30),
        variance};
  }
  double rms_error(const VectorXd& b, const VectorXd& t) const {
    VectorXd z(b.size() + t.size());
    z << b, t;
    return (tau - x * z).norm() / std::sqrt(static_cast<double>(tau.size()));
  }
  VectorXd least_squares_beta() const {
    return SymmetricSolver(x.transpose() * x).solve(x.transpose() * tau).head(beta.size());
  }
};

VectorXd all_parameters(const PhysicalFit& fit) {
  VectorXd out(10 * static_cast<Index>(fit.inertia.size()));
  for (std::size_t i = 0; i < fit.inertia.size(); ++i) {
    const auto values = to_array(fit.inertia[i]);
    out.segment(10 * static_cast<Index>(i), 10) = Eigen::Map<const VectorXd>(values.data(), 10);
  }
  return out;
}

/// Base parameters of rotors, one a joint.
VectorXd in_base(const Experiment& e, const VectorXd& rotor) {
  VectorXd out = VectorXd::Zero(e.beta.size());
  for (Index j = 0; j < rotor.size(); ++j) {
    if (rotor[j] != 0) out += rotor[j] * rotor_in_base(e.chain, e.base, j);
  }
  return out;
}

void expect_possible(const PhysicalFit& fit) {
  for (const auto& link : fit.inertia) {
    EXPECT_EQ(Eigen::LLT<Eigen::Matrix4d>(pseudo_inertia(link)).info(), Eigen::Success);
  }
  for (const double value : fit.smallest_eigenvalue) EXPECT_GT(value, 0);
}

TEST(Physical, DataThatPossibleBodiesExplainKeepsItsLeastSquaresSolution) {
  test::Chains chains(5);
  for (int k = 0; k < 12; ++k) {
    SCOPED_TRACE(k);
    Robot robot = chains.robot(static_cast<std::size_t>(2 + k % 6));
    const Experiment e(robot, 0, 7);
    for (const bool with_prior : {true, false}) {
      PhysicalProblem problem = e.problem();
      Robot bare = robot;
      if (!with_prior) {
        for (Joint& joint : bare.joints) joint.inertial.reset();
      }
      const PhysicalFit fit = fit_physical({bare, e.chain, e.base, problem.information, problem.projection,
                                            problem.lower, problem.upper, problem.variance});
      expect_possible(fit);
      EXPECT_FALSE(fit.constrained);
      EXPECT_EQ((fit.beta - e.least_squares_beta()).norm(), 0);
      const VectorXd from_bodies = e.base.grouping * all_parameters(fit);
      EXPECT_LT((from_bodies - fit.beta).norm(), 1e-11 * all_parameters(fit).norm());
      // With the truth as prior, the null space is the truth's.
      if (with_prior) {
        EXPECT_LT((all_parameters(fit) - e.parameters).norm(), 1e-6 * e.parameters.norm());
      }
    }
  }
}

TEST(Physical, ThePumasImpossibleLinkIsGroupedIntoPossibleBodies) {
  // Link 3 of the published set misses the triangle inequality by 9 %; what the torque sees of it is possible.
  const Experiment e(read_urdf(test::puma560), 0, 1);
  const PhysicalFit fit = fit_physical(e.problem());
  expect_possible(fit);
  EXPECT_FALSE(fit.constrained);
  EXPECT_LT((fit.beta - e.beta).norm(), 1e-9 * e.beta.norm());
}

TEST(Physical, PointsAndRodsAreNotMovedByTheMargin) {
  test::Chains chains(11);
  for (int k = 0; k < 12; ++k) {
    SCOPED_TRACE(k);
    Robot robot = chains.robot(static_cast<std::size_t>(2 + k % 6));
    for (Joint& joint : robot.joints) {
      const Eigen::Vector3d direction =
          chains.vector(1).normalized();  // one draw a statement: the same robots everywhere
      const Eigen::Vector3d axis = direction * (chains.coin() ? 0.3 : 0.0);
      joint.inertial->tensor =
          joint.inertial->mass * (axis.squaredNorm() * Eigen::Matrix3d::Identity() - axis * axis.transpose());
    }
    const Experiment e(robot, 0, 8);
    Robot bare = robot;
    for (Joint& joint : bare.joints) joint.inertial.reset();
    const PhysicalProblem problem = e.problem();
    const PhysicalFit fit = fit_physical({bare, e.chain, e.base, problem.information, problem.projection, problem.lower,
                                          problem.upper, problem.variance});
    expect_possible(fit);
    // They lie on the edge of what is possible, and rounding decides on which side the least squares are. Products of
    // rows in double precision tell the square of an error to 1e-16 of the torque's.
    const double rms = e.tau.norm() / std::sqrt(static_cast<double>(e.tau.size()));
    EXPECT_LT(e.rms_error(fit.beta, fit.theta), 1e-8 * rms);
    EXPECT_LT((e.base.grouping * all_parameters(fit) + in_base(e, fit.rotor) - fit.beta).norm(),
              1e-9 * e.parameters.norm());
  }
}

TEST(Physical, RotorsOfTheFirstJointsAreNoBodies) {
  // The PUMA's gears make more of its rotors than its links have. Joint 2's, here twice as large, is in no body: joint
  // 1 would have to turn it, too.
  const Robot robot = read_urdf(test::puma560);
  VectorXd rotor = VectorXd::Zero(6);
  rotor[0] = 1.14;
  rotor[1] = 2 * 4.71;
  Experiment e(robot, 0.01, 4);
  e.tau += e.x.leftCols(e.beta.size()) * in_base(e, rotor);
  e.beta += in_base(e, rotor);
  const PhysicalProblem p = e.problem();
  const PhysicalFit fit = fit_physical(p);
  expect_possible(fit);
  EXPECT_LT((e.base.grouping * all_parameters(fit) + in_base(e, fit.rotor) - fit.beta).norm(), 1e-9 * fit.beta.norm());
  const double truth = e.rms_error(e.beta, e.theta);
  EXPECT_LT(e.rms_error(fit.beta, fit.theta), 1.001 * truth);
  EXPECT_GT(fit.rotor[1], 2);
  EXPECT_EQ(fit.rotor.tail(4).maxCoeff(), 0);  // these have a column of their own
  EXPECT_NE(share_comments(fit)[1].find("rotor with"), std::string::npos);
  // Bodies alone do worse.
  std::vector<Eigen::Matrix4d> prior;
  for (Index i = 0; i < 6; ++i)
    prior.push_back(pseudo_inertia(to_link_inertia(possible_body(*robot.joints[static_cast<std::size_t>(i)].inertial),
                                                   e.chain.urdf_in_dh[static_cast<std::size_t>(i)])));
  const ConsistentFit bodies = fit_consistent(
      {p.information, p.projection, p.lower, p.upper, e.base.grouping, e.base.columns, prior, p.variance});
  EXPECT_TRUE(bodies.constrained);
  EXPECT_GT(e.rms_error(bodies.beta, bodies.theta), 1.05 * truth);
}

TEST(Physical, NoisyDataGivesPossibleBodiesAtLittleCost) {
  test::Chains chains(3);
  int constrained = 0;
  for (int k = 0; k < 12; ++k) {
    SCOPED_TRACE(k);
    const Experiment e(chains.robot(6, false), 0.3, 20 + static_cast<std::uint64_t>(k));
    const PhysicalProblem problem = e.problem();
    const auto start = std::chrono::steady_clock::now();
    const PhysicalFit fit = fit_physical(problem);
    const double ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    EXPECT_LT(ms, 2000);
    RecordProperty("ms", std::to_string(ms));
    expect_possible(fit);
    constrained += fit.constrained;
    EXPECT_GE(fit.theta.minCoeff(), 0);
    // The truth is possible and is the prior, so the best possible bodies fit the data at least as well as it does.
    EXPECT_LE(e.rms_error(fit.beta, fit.theta), (1 + 1e-9) * e.rms_error(e.beta, e.theta));
  }
  EXPECT_GE(constrained, 6);
}

TEST(Physical, ConstrainedFitIsTheMinimum) {
  test::Chains chains(21);
  int constrained = 0;
  for (int k = 0; k < 15; ++k) {
    SCOPED_TRACE(k);
    const Experiment e(chains.robot(static_cast<std::size_t>(2 + k % 6)), 0.1, 50 + static_cast<std::uint64_t>(k));
    const PhysicalProblem p = e.problem();
    std::vector<Eigen::Matrix4d> prior;  // nothing that resembles the truth
    for (std::size_t i = 0; i < e.robot.size(); ++i)
      prior.push_back(pseudo_inertia(to_link_inertia(chains.inertial(), Eigen::Isometry3d::Identity())));
    const ConsistentFit fit = fit_consistent(
        {p.information, p.projection, p.lower, p.upper, e.base.grouping, e.base.columns, prior, p.variance});
    if (!fit.constrained) continue;
    ++constrained;
    const auto parameters = [](const std::vector<Eigen::Matrix4d>& bodies) {
      VectorXd pi(10 * static_cast<Index>(bodies.size()));
      for (std::size_t i = 0; i < bodies.size(); ++i) {
        const auto values = to_array(from_pseudo_inertia(bodies[i]));
        pi.segment(10 * static_cast<Index>(i), 10) = Eigen::Map<const VectorXd>(values.data(), 10);
      }
      return pi;
    };
    // squared error / 2 variance + divergence, infinite where impossible
    const auto objective = [&](const std::vector<Eigen::Matrix4d>& bodies) -> double {
      const double error = e.rms_error(e.base.grouping * parameters(bodies), fit.theta);
      double sum = static_cast<double>(e.tau.size()) * error * error / (2 * p.variance);
      for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (Eigen::LLT<Eigen::Matrix4d>(bodies[i]).info() != Eigen::Success) return INFINITY;
        const Eigen::Matrix4d ratio = prior[i].inverse() * bodies[i];
        sum += ratio.trace() - std::log(ratio.determinant());
      }
      return sum;
    };
    const double best = objective(fit.bodies);
    Random random(4);
    for (int trial = 0; trial < 200; ++trial) {
      // B (1 + s) B^T stays possible; s from large to small
      std::vector<Eigen::Matrix4d> other = fit.bodies;
      const double size = std::pow(10.0, -4 * random.uniform());
      for (Eigen::Matrix4d& body : other) {
        Eigen::Matrix4d step;
        for (double& value : step.reshaped()) value = size * random.normal();
        const Eigen::Matrix4d root = Eigen::LLT<Eigen::Matrix4d>(body).matrixL();
        body = root * (Eigen::Matrix4d::Identity() + (step + step.transpose()) / 2) * root.transpose();
      }
      EXPECT_GE(objective(other), best - 1e-6);
    }
  }
  EXPECT_GE(constrained, 5);
}

TEST(Physical, CoefficientsKeepTheirBounds) {
  test::Chains chains(4);
  Experiment e(chains.robot(3, false), 0, 9);
  e.tau -= e.x.col(e.beta.size()) * 3;  // Coulomb friction of joint 1: 1 - 3
  const PhysicalFit fit = fit_physical(e.problem());
  EXPECT_TRUE(fit.constrained);
  EXPECT_GE(fit.theta[0], 0);
  EXPECT_LT(fit.theta[0], 1e-3);
  // A coefficient exactly on its bound is not beyond it.
  Experiment zero(e.robot, 0, 9);
  PhysicalProblem problem = zero.problem();
  problem.lower[0] = SymmetricSolver(problem.information).solve(problem.projection)[zero.beta.size()];
  const PhysicalFit on_bound = fit_physical(problem);
  EXPECT_FALSE(on_bound.constrained);
  EXPECT_LT((all_parameters(on_bound) - zero.parameters).norm(), 1e-6 * zero.parameters.norm());
}

TEST(Physical, TellsWhatTheDataDecides) {
  // A pendulum about a horizontal axis: its centre across the axis only times mass; nothing along the axis.
  test::Chains chains(6);
  Robot robot = chains.robot(2, false);
  robot.gravity = {0, 0, -9.81};
  for (Joint& joint : robot.joints) {
    joint.type = JointType::revolute;
    joint.axis = Eigen::Vector3d::UnitY();
    joint.origin = Eigen::Isometry3d::Identity();
    joint.origin.translation() = Eigen::Vector3d(0.5, 0, 0);
    joint.inertial.reset();
  }
  Robot truth = robot;
  for (Joint& joint : truth.joints) {
    joint.inertial = chains.inertial();
    joint.inertial->mass = 3;
    joint.inertial->centre = {0.25, 0.1, 0};
  }
  const Experiment e(truth, 0.01, 3);
  const PhysicalProblem p = e.problem();
  const PhysicalFit fit =
      fit_physical({robot, e.chain, e.base, p.information, p.projection, p.lower, p.upper, p.variance});
  EXPECT_LT(fit.share[0].mass, determined_share);
  EXPECT_LT(fit.share[1].mass, determined_share);
  for (const DataShare& share : fit.share) EXPECT_LT(share.centre.y(), 1e-6);  // along the axes
  const MassCheck check = mass_check(robot, e.chain, fit);
  EXPECT_FALSE(check.urdf_mass);
  EXPECT_NEAR(check.links[0].identified.mass + check.links[1].identified.mass, check.mass, 1e-9);
  // m c is what the torque sees of the last link
  EXPECT_GT(fit.share[1].first_moment.x(), determined_share);
  EXPECT_LT(fit.share[1].first_moment.y(), 1e-6);
  EXPECT_NEAR(check.links[1].identified.mass * check.links[1].identified.centre.x(), 0.75, 0.05);
}

TEST(Physical, MotionThatSeesLittleLeavesTheRestToThePrior) {
  test::Chains chains(12);
  const Robot robot = chains.robot(6, false);
  Experiment e(robot, 0.02, 5);
  // joints 3 to 6 as if they had never been recorded
  for (Index k = 0; k < e.x.rows(); ++k) {
    if (k % 6 < 2) continue;
    e.x.row(k).setZero();
    e.tau[k] = 0;
  }
  PhysicalProblem problem = e.problem();
  const PhysicalFit fit = fit_physical(problem);
  expect_possible(fit);
  EXPECT_TRUE(fit.beta.allFinite());
  EXPECT_LE(e.rms_error(fit.beta, fit.theta), (1 + 1e-9) * e.rms_error(e.beta, e.theta));
  // one scale of torque for all: masses scale, nothing else
  const PhysicalFit scaled = [&] {
    Robot heavy = robot;
    for (Joint& joint : heavy.joints) {
      joint.inertial->mass *= 1000;
      joint.inertial->tensor *= 1000;
    }
    return fit_physical({heavy, e.chain, e.base, problem.information / 1e6, problem.projection / 1e3, problem.lower,
                         problem.upper, problem.variance});
  }();
  EXPECT_LT((all_parameters(scaled) / 1000 - all_parameters(fit)).norm(), 1e-5 * all_parameters(fit).norm());
}

TEST(Physical, InertialGoesToTheDhFrameAndBack) {
  test::Chains chains(2);
  const Robot robot = chains.robot(6);
  const DhChain chain = to_dh(robot);
  for (std::size_t i = 0; i < robot.size(); ++i) {
    const Inertial& body = *robot.joints[i].inertial;
    const Inertial back = to_inertial(to_link_inertia(body, chain.urdf_in_dh[i]), chain.urdf_in_dh[i]);
    EXPECT_NEAR(back.mass, body.mass, 1e-12);
    EXPECT_LT((back.centre - body.centre).norm(), 1e-12);
    EXPECT_LT((back.tensor - body.tensor).norm(), 1e-12 * body.mass);
  }
}

}  // namespace
}  // namespace fxdyn
