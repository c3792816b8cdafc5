// The second campaign's own friction, against closed forms, and its robots.

#include "tests/campaign/healthy_friction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "host_tools/robot/robot.hpp"
#include "host_tools/support/files.hpp"
#include "tests/campaign/outside.hpp"
#include "tests/support/files.hpp"

namespace fxdyn::campaign {
namespace {

using Eigen::VectorXd;

DryFriction friction(Friction kind) { return {kind, 2, 0.01, 0.4, 0.1, 0.002, 5}; }

/// Friction itself: what is added and the catalogue's sign.
VectorXd whole(const DryFriction& f, const VectorXd& t, const VectorXd& dq) {
  return added_friction(f, t, dq) + f.coulomb * (dq.array() / f.width).tanh().matrix();
}

TEST(HealthyFriction, LuGreSlidesAtItsCurve) {
  const VectorXd t = VectorXd::LinSpaced(2001, 0, 2);
  for (const double speed : {0.02, 0.1, 0.5}) {
    const VectorXd force = whole(friction(Friction::lugre), t, VectorXd::Constant(t.size(), speed));
    EXPECT_NEAR(force.tail(1)[0], 2 * (1 + 0.4 * std::exp(-std::pow(speed / 0.1, 2))), 1e-3) << speed;
  }
}

// dz/dt = v (1 - z / z_ss) at constant speed: the bristle nears its end over z_ss / v.
TEST(HealthyFriction, LuGreBuildsUpOverItsDistance) {
  DryFriction f = friction(Friction::lugre);
  f.damping = 0;
  f.excess = 0;
  const VectorXd t = VectorXd::LinSpaced(1001, 0, 0.1), dq = VectorXd::Constant(t.size(), 0.02);
  const VectorXd force = whole(f, t, dq);
  for (const Eigen::Index k : {100, 500, 1000}) EXPECT_NEAR(force[k], 2 * (1 - std::exp(-0.02 * t[k] / 0.002)), 1e-3);
}

// Springs in parallel: the force depends on the path alone, and closes its loop.
TEST(HealthyFriction, MaxwellSlipIsOfThePathAlone) {
  const DryFriction f = friction(Friction::maxwell);
  const auto at_end = [&](double seconds) {
    const VectorXd t = VectorXd::LinSpaced(4001, 0, seconds);
    const VectorXd dq = 0.003 * 2 * M_PI / seconds * (2 * M_PI / seconds * t.array()).cos().matrix();
    return whole(f, t, dq);
  };
  const VectorXd fast = at_end(1), slow = at_end(10);
  EXPECT_LT((fast - slow).cwiseAbs().maxCoeff(), 1e-2);
  EXPECT_GT((fast.head(1000) - fast.segment(1000, 1000).reverse()).cwiseAbs().maxCoeff(), 0.5);  // it remembers
}

TEST(HealthyFriction, NothingIsAddedToTheCataloguesOwn) {
  const VectorXd t = VectorXd::LinSpaced(10, 0, 1);
  EXPECT_EQ(added_friction(friction(Friction::catalogue), t, t).norm(), 0);
}

TEST(DrawnRobots, AreReadAndDifferAndAreTheSameForASeed) {
  std::set<std::string> kinds;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const TestRobot robot = draw_robot(seed);
    const auto file = test::folder() / "drawn.urdf";
    write_file(file, robot.urdf_text);
    const Robot read = read_urdf(file);
    ASSERT_EQ(read.size(), robot.rated_torque.size()) << robot.name;
    ASSERT_GE(read.size(), 2U);
    for (const double rated : robot.rated_torque) EXPECT_GT(rated, 0) << robot.name;
    EXPECT_EQ(draw_robot(seed).urdf_text, robot.urdf_text);
    kinds.insert(robot.name.substr(0, robot.name.rfind('_')));
  }
  EXPECT_GT(kinds.size(), 8U);
}

TEST(DrawnCases, HaveNamesOfTheirOwnAndKnowWhatTheyHide) {
  std::set<std::string> names;
  std::size_t clean = 0, outside = 0;
  for (const Case& one : drawn_cases(7000, 200)) {
    names.insert(one.name);
    clean += one.effects.empty();
    outside += !one.effects.empty() && is_outside(one.effects[0].effect);
  }
  EXPECT_EQ(names.size(), 200U);
  EXPECT_GT(clean, 20U);
  EXPECT_GT(outside, 25U);
}

}  // namespace
}  // namespace fxdyn::campaign
