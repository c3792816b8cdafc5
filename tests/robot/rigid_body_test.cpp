#include <gtest/gtest.h>

#include <kdl/chainidsolver_recursive_newton_euler.hpp>

#include "tests/support/chains.hpp"
#include "tests/support/kdl.hpp"

namespace fxdyn {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using test::Chains;
using test::to_kdl;

VectorXd kdl_torques(const Robot& robot, const VectorXd& q, const VectorXd& dq, const VectorXd& ddq) {
  const KDL::Chain chain = to_kdl(robot);
  KDL::ChainIdSolver_RNE solver(chain, to_kdl(robot.gravity));
  const auto array = [](const VectorXd& v) {
    KDL::JntArray result(static_cast<unsigned>(v.size()));
    result.data = v;
    return result;
  };
  KDL::JntArray tau(static_cast<unsigned>(q.size()));
  EXPECT_GE(solver.CartToJnt(array(q), array(dq), array(ddq), KDL::Wrenches(robot.size(), KDL::Wrench::Zero()), tau),
            0);
  return tau.data;
}

void expect_same(const Robot& robot, Chains& chains) {
  for (int k = 0; k < 20; ++k) {
    const VectorXd q = chains.joints(robot.size(), 3), dq = chains.joints(robot.size(), 4),
                   ddq = chains.joints(robot.size(), 10);
    const VectorXd expected = kdl_torques(robot, q, dq, ddq);
    EXPECT_LT((test::torques(robot, q, dq, ddq) - expected).norm() / expected.norm(), 1e-9);
  }
}

/// Kinetic and potential energy from the definition, in the base frame.
double energy(const Robot& robot, const VectorXd& q, const VectorXd& dq) {
  const auto poses = test::poses(robot, q);
  double sum = 0;
  for (std::size_t i = 0; i < robot.size(); ++i) {
    const Inertial& body = *robot.joints[i].inertial;
    const Vector3d centre = poses[i] * body.centre;
    Vector3d velocity = Vector3d::Zero(), omega = Vector3d::Zero();
    for (std::size_t j = 0; j <= i; ++j) {
      const double rate = dq[static_cast<Eigen::Index>(j)];
      const Vector3d axis = poses[j].linear() * robot.joints[j].axis * rate;
      if (robot.joints[j].type == JointType::revolute) {
        omega += axis;
        velocity += axis.cross(centre - poses[j].translation());
      } else {
        velocity += axis;
      }
    }
    const Vector3d turning = poses[i].linear().transpose() * omega;
    sum += 0.5 * body.mass * velocity.squaredNorm() + 0.5 * turning.dot(body.tensor * turning) -
           body.mass * robot.gravity.dot(centre);
  }
  return sum;
}

TEST(RigidBody, AgreesWithKdlOnPuma560) {
  Chains chains(11);
  expect_same(read_urdf(test::puma560), chains);
}

TEST(RigidBody, AgreesWithKdlOnRandomChains) {
  Chains chains(12);
  for (int k = 0; k < 20; ++k) expect_same(chains.robot(1 + static_cast<std::size_t>(k) % 7), chains);
}

TEST(RigidBody, PowerOfTheDrivesIsTheChangeOfEnergy) {
  Chains chains(13);
  std::vector<Robot> robots{read_urdf(test::puma560)};
  for (std::size_t k = 0; k < 20; ++k) robots.push_back(chains.robot(1 + k % 7));
  for (const Robot& robot : robots) {
    const VectorXd q = chains.joints(robot.size(), 2), dq = chains.joints(robot.size(), 1),
                   ddq = chains.joints(robot.size(), 3);
    const auto at = [&](double t) { return energy(robot, q + t * dq + t * t / 2 * ddq, dq + t * ddq); };
    const double h = 2e-3;
    const double change = (45 * (at(h) - at(-h)) - 9 * (at(2 * h) - at(-2 * h)) + (at(3 * h) - at(-3 * h))) / (60 * h);
    const VectorXd tau = test::torques(robot, q, dq, ddq);
    EXPECT_NEAR(tau.dot(dq), change, 1e-8 * tau.norm() * dq.norm());
  }
}

TEST(RigidBody, Puma560HoldsItselfAgainstGravity) {
  // At q = 0 the upper arm is level: torque of joint 2 by hand from masses and levers.
  const Robot robot = read_urdf(test::puma560);
  VectorXd q = VectorXd::Zero(6);
  const VectorXd rest = VectorXd::Zero(6);
  double moment = 0;
  const auto poses = test::poses(robot, q);
  for (std::size_t i = 1; i < 6; ++i) {
    moment += robot.joints[i].inertial->mass * 9.81 * (poses[i] * robot.joints[i].inertial->centre).x();
  }
  const VectorXd tau = test::torques(robot, q, rest, rest);
  EXPECT_NEAR(tau[1], moment, 1e-12);
  EXPECT_NEAR(tau[1], 37.48, 0.01);  // gravload(qz) of the Robotics Toolbox
  EXPECT_NEAR(tau[0], 0, 1e-12);
}

}  // namespace
}  // namespace fxdyn
