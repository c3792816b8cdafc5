#include <gtest/gtest.h>

#include "tests/support/chains.hpp"

namespace fxdyn {
namespace {

using test::Chains;

/// The length along z of the textbook's four parameters, for joints at q = 0.
double along_z(const LinkGeometry<Real>& link) { return -link.p.y * link.sin_alpha + link.p.z * link.cos_alpha; }

/// Frame i in frame i-1, from the convention's definition.
Eigen::Isometry3d transform(const LinkGeometry<Real>& link, double q) {
  const double slide = link.type == JointType::prismatic ? q : 0;
  const double theta = link.theta + (link.type == JointType::revolute ? q : 0);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose = pose * Eigen::AngleAxisd(std::atan2(link.sin_alpha, link.cos_alpha), Eigen::Vector3d::UnitX());
  pose.translation() = Eigen::Vector3d(link.p.x, link.p.y - slide * link.sin_alpha, link.p.z + slide * link.cos_alpha);
  return pose * Eigen::AngleAxisd(theta, Eigen::Vector3d::UnitZ());
}

/// Largest difference of the links' poses between both descriptions, in units of the chain's largest length.
double error(const Robot& robot, const Eigen::VectorXd& q) {
  const DhChain chain = to_dh(robot);
  const auto at_zero = test::poses(robot, Eigen::VectorXd::Zero(q.size()));
  const auto expected = test::poses(robot, q);
  Eigen::Isometry3d frame = at_zero[0] * chain.urdf_in_dh[0].inverse();  // frame 0 is frame 1 at q = 0
  double size = 1, worst = 0;
  for (std::size_t i = 0; i < robot.size(); ++i) {
    frame = frame * transform(chain.links[i], q[static_cast<Eigen::Index>(i)]);
    size = std::max({size, std::abs(chain.links[i].p.x), std::abs(along_z(chain.links[i]))});
    worst = std::max(worst, ((frame * chain.urdf_in_dh[i]).matrix() - expected[i].matrix()).cwiseAbs().maxCoeff());
  }
  return worst / size;
}

TEST(Dh, MovesLikeTheUrdfOnRandomChains) {
  Chains chains(1);
  for (int k = 0; k < 500; ++k) {
    const Robot robot = chains.robot(1 + static_cast<std::size_t>(k) % 8);
    EXPECT_LT(error(robot, chains.joints(robot.size(), 3)), 1e-11) << "chain " << k;
  }
}

TEST(Dh, FirstAndLastFrameAreSimple) {
  Chains chains(2);
  for (int k = 0; k < 100; ++k) {
    const DhChain chain = to_dh(chains.robot(1 + static_cast<std::size_t>(k) % 6));
    const auto &first = chain.links.front(), &last = chain.links.back();
    EXPECT_EQ(std::vector({first.cos_alpha, first.sin_alpha, first.p.x, along_z(first), first.theta}),
              std::vector({1.0, 0.0, 0.0, 0.0, 0.0}));
    EXPECT_EQ(std::vector({along_z(last), last.theta}), std::vector({0.0, 0.0}));
  }
}

TEST(Dh, GravityIsTurnedIntoTheFirstFrame) {
  Chains chains(3);
  const Robot robot = chains.robot(4);
  const DhChain chain = to_dh(robot);
  const Eigen::Isometry3d frame = robot.joints[0].origin * chain.urdf_in_dh[0].inverse();
  EXPECT_LT((frame.linear() * chain.up + robot.gravity).norm(), 1e-12);
}

TEST(Dh, Puma560HasItsTextbookParameters) {
  const DhChain chain = to_dh(read_urdf(test::puma560));
  ASSERT_EQ(chain.links.size(), 6U);
  const std::vector<double> sin_alpha{0, 1, 0, -1, 1, -1}, a{0, 0, 0.4318, 0.0203, 0, 0}, d{0, 0, 0, 0.4318, 0, 0};
  double offsets = 0;
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(std::abs(chain.links[i].sin_alpha), std::abs(sin_alpha[i])) << i;
    EXPECT_NEAR(chain.links[i].p.x, a[i], 1e-15) << i;
    offsets += std::abs(along_z(chain.links[i]));
    EXPECT_NEAR(std::sin(2 * chain.links[i].theta), 0, 1e-15) << i;
  }
  EXPECT_NEAR(offsets, 0.4318 + 0.15005, 1e-15);
  EXPECT_EQ(chain.up, Eigen::Vector3d(0, 0, 9.81));
  Chains chains(4);
  EXPECT_LT(error(read_urdf(test::puma560), chains.joints(6, 3)), 1e-14);
}

TEST(Dh, InertiaMovesByTheParallelAxisTheorem) {
  Chains chains(5);
  const Inertial body = chains.inertial();
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  pose.translation() = Eigen::Vector3d(0.1, -0.2, 0.3);
  const LinkInertia<Real> link = to_link_inertia(body, pose);
  const Eigen::Vector3d centre = pose * body.centre;
  const Eigen::Matrix3d tensor =
      pose.linear() * body.tensor * pose.linear().transpose() +
      body.mass * (centre.squaredNorm() * Eigen::Matrix3d::Identity() - centre * centre.transpose());
  EXPECT_NEAR(link.yy + link.zz, tensor(0, 0), 1e-14);
  EXPECT_NEAR(link.xx + link.zz, tensor(1, 1), 1e-14);
  EXPECT_NEAR(link.xx + link.yy, tensor(2, 2), 1e-14);
  EXPECT_NEAR(-link.xy, tensor(0, 1), 1e-14);
  EXPECT_NEAR(-link.xz, tensor(0, 2), 1e-14);
  EXPECT_NEAR(-link.yz, tensor(1, 2), 1e-14);
  EXPECT_NEAR(link.h.x, body.mass * centre.x(), 1e-14);
}

}  // namespace
}  // namespace fxdyn
