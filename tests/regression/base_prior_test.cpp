#include "host_tools/regression/base_prior.hpp"

#include <gtest/gtest.h>

#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Two links in a row whose axes are parallel: the first one's inertia about its axis holds its rotor.
Robot arm() {
  Robot robot;
  robot.gravity = {0, -9.81, 0};
  for (int i = 0; i < 2; ++i) {
    Joint joint;
    joint.name = i == 0 ? "shoulder" : "elbow";
    joint.link = i == 0 ? "upper" : "lower";
    if (i == 1) joint.origin.translation() = Eigen::Vector3d(0.5, 0, 0);
    Inertial body;
    body.mass = 4 - 2 * i;
    body.centre = {0.25, 0, 0};
    body.tensor = Eigen::Vector3d(0.02, 0.1, 0.1).asDiagonal();
    joint.inertial = body;
    robot.joints.push_back(joint);
  }
  return robot;
}

struct Case {
  Robot robot = arm();
  DhChain chain = to_dh(robot);
  BaseSet base = find_base(chain);
};

TEST(BasePrior, ItsMeanGivesTheTorqueOfTheUrdfsLinks) {
  const Case c;
  const BasePrior prior = prior_of_urdf(c.robot, c.chain, c.base, 0.3);
  Regressor regressor(c.chain);
  const Eigen::Vector2d still = Eigen::Vector2d::Zero(), elbow = Eigen::Vector2d::UnitY();
  const auto torque = [&](const Eigen::Vector2d& ddq) {
    const MatrixXd& y = regressor(still, still, ddq);
    VectorXd tau = VectorXd::Zero(2);
    for (std::size_t i = 0; i < c.base.columns.size(); ++i)
      tau += y.col(c.base.columns[i]) * prior.mean[static_cast<Eigen::Index>(i)];
    return tau;
  };
  // Stretched out, 4 kg at 0.25 m and 2 kg at 0.75 m; the lower link has 0.1 kg m^2 about its centre.
  EXPECT_NEAR(torque(still)[0], 9.81 * (4 * 0.25 + 2 * 0.75), 1e-12);
  EXPECT_NEAR(torque(still)[1], 9.81 * 2 * 0.25, 1e-12);
  EXPECT_NEAR((torque(elbow) - torque(still))[1], 0.1 + 2 * 0.25 * 0.25, 1e-12);
}

TEST(BasePrior, AMassIsOffByTheRelativeError) {
  // Of a body that turns in the plane, h = m c alone has information about m: its deviation is that of |h|.
  const Case c;
  const BasePrior loose = prior_of_urdf(c.robot, c.chain, c.base, 0.3),
                  tight = prior_of_urdf(c.robot, c.chain, c.base, 0.03);
  EXPECT_TRUE((100 * loose.information).isApprox(tight.information, 1e-9));
  // Cov P_ij, P_kl = (P_ik P_jl + P_il P_jk) / 2 relative_error^2: of h_x it is (J_xx m + h_x^2) / 2, of m itself m^2.
  for (std::size_t i = 0; i < c.base.columns.size(); ++i) {
    if (parameter_name(c.base.columns[i]) != "hx2") continue;
    const auto k = static_cast<Eigen::Index>(i);
    const double j_xx = 0.09 + 2 * 0.0625;  // integral of x^2: (-Ixx + Iyy + Izz) / 2, and m c^2
    const MatrixXd covariance = loose.information.completeOrthogonalDecomposition().pseudoInverse();
    EXPECT_NEAR(covariance(k, k), 0.09 * (j_xx * 2 + 0.25) / 2, 1e-6);
  }
}

TEST(BasePrior, SaysNothingOfARotorThatABaseParameterHolds) {
  const Case c;
  const VectorXd rotor = rotor_in_base(c.chain, c.base, 0);
  ASSERT_GT(rotor.size(), 0);
  const BasePrior prior = prior_of_urdf(c.robot, c.chain, c.base, 0.3);
  EXPECT_NEAR(prior.square(prior.mean + 100 * rotor), 0, 1e-6);
  EXPECT_GT(prior.square(1.5 * prior.mean), 1);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<MatrixXd>(prior.information).eigenvalues()[0], -1e-9);
}

TEST(BasePrior, ALinkWithoutInertiaIsRefused) {
  Case c;
  c.robot.joints[1].inertial.reset();
  EXPECT_THROW(prior_of_urdf(c.robot, c.chain, c.base, 0.3), InputError);
}

}  // namespace
}  // namespace fxdyn
