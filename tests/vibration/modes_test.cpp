#include "host_tools/vibration/modes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/vibration/shaper.hpp"
#include "tests/simulate/support.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double pi = std::numbers::pi;
constexpr double mass = 5, lever = 0.3, tensor = 0.05, inertia = tensor + mass * lever * lever, rotor = 0.6;
constexpr double compliance = 3e-4, relaxation = 1e-3;

Joint axis(const std::string& name, double along) {
  Joint joint;
  joint.name = name;
  joint.type = JointType::revolute;
  joint.origin = Eigen::Isometry3d::Identity();
  joint.origin.translation().x() = along;
  joint.axis = Eigen::Vector3d::UnitZ();
  Inertial body;
  body.mass = mass;
  body.centre = {lever, 0, 0};
  body.tensor = tensor * Eigen::Matrix3d::Identity();
  joint.inertial = body;
  return joint;
}

IdentifiedModel arm(const std::vector<Joint>& joints) {
  Robot robot;
  robot.joints = joints;
  robot.gravity = {0, 0, -9.81};
  IdentifiedModel model = test::plant_of(robot);
  for (JointFit& fit : model.joints)
    fit.effects = {test::effect("rotor_inertia", {}, {rotor}), test::effect("viscous", {}, {2}),
                   test::effect("elasticity", {relaxation}, {compliance})};
  return model;
}

TEST(LinkMass, IsThatOfTwoLevers) {
  const IdentifiedModel model = arm({axis("one", 0), axis("two", 0.5)});
  const double bend = 0.7, c = std::cos(bend);
  const MatrixXd m = link_mass(model, VectorXd{{0.3, bend}});
  const double coupled = mass * lever * 0.5 * c;
  EXPECT_NEAR(m(1, 1), inertia, 1e-12);
  EXPECT_NEAR(m(0, 1), inertia + coupled, 1e-12);
  EXPECT_NEAR(m(1, 0), m(0, 1), 1e-12);
  EXPECT_NEAR(m(0, 0), 2 * inertia + mass * 0.25 + 2 * coupled, 1e-12);
}

TEST(Modes, OfALeverWhoseMotorIsHeld) {
  const std::vector<Mode> modes = vibration_modes(arm({axis("one", 0)}), VectorXd::Zero(1), {});
  ASSERT_EQ(modes.size(), 1U);
  const double w = 1 / std::sqrt(compliance * inertia);
  EXPECT_NEAR(modes[0].frequency_hz, w / (2 * pi), 1e-9);
  EXPECT_NEAR(modes[0].damping, 0.5 * w * relaxation, 1e-9);
}

TEST(Modes, OfAFreeMotorAreThoseOfTwoMassesOnASpring) {
  const VectorXd none = VectorXd::Zero(1);
  const std::vector<Mode> modes = vibration_modes(arm({axis("one", 0)}), none, {none, none});
  ASSERT_EQ(modes.size(), 1U);
  const double reduced = rotor * inertia / (rotor + inertia);
  EXPECT_NEAR(modes[0].frequency_hz, 1 / std::sqrt(compliance * reduced) / (2 * pi), 1e-6);
}

TEST(Modes, OfAControlledMotorLieBelowThoseOfAHeldOne) {
  const IdentifiedModel model = arm({axis("one", 0)});
  const VectorXd q = VectorXd::Zero(1);
  const MotorLoop loop = motor_loop(model, q, 32, 0.3);
  const double w = 2 * pi * 32;
  EXPECT_NEAR(loop.stiffness[0], (inertia + rotor) * w * w, 1e-6 * loop.stiffness[0]);
  EXPECT_NEAR(loop.damping[0], 0.6 * (inertia + rotor) * w, 1e-6 * loop.damping[0]);
  const std::vector<Mode> modes = vibration_modes(model, q, loop);
  ASSERT_EQ(modes.size(), 2U);
  const Mode held = vibration_modes(model, q, {})[0];
  EXPECT_LT(modes[0].frequency_hz, held.frequency_hz);
  EXPECT_GT(modes[0].damping, held.damping);
  // where the mode is slow the controller is a spring in series, kp - J w^2 at the mode's own frequency
  const double own = 2 * pi * modes[0].frequency_hz;
  const double series = 1 / (compliance + 1 / (loop.stiffness[0] - rotor * own * own));
  EXPECT_NEAR(own, std::sqrt(series / inertia), 0.03 * own);
}

TEST(Modes, AreFewerWhereAnInertiaIsNotPositive) {
  IdentifiedModel model = arm({axis("one", 0), axis("two", 0.5)});
  const VectorXd q{{0.1, 0.4}};
  EXPECT_EQ(vibration_modes(model, q, {}).size(), 2U);
  model.inertia[1].xx -= 2;  // second moments: what turns about z is xx + yy
  for (const Mode& mode : vibration_modes(model, q, {})) {
    EXPECT_TRUE(std::isfinite(mode.frequency_hz));
    EXPECT_GE(mode.damping, 0);
  }
  EXPECT_LT(vibration_modes(model, q, {}).size(), 2U);
  for (JointFit& joint : model.joints) joint.effects.clear();
  EXPECT_TRUE(vibration_modes(model, q, {}).empty());
}

TEST(Bands, CoverTheModesOfEveryPoseOnTheWay) {
  const IdentifiedModel model = arm({axis("one", 0), axis("two", 0.5)});
  Reference path{0.002, MatrixXd::Zero(200, 2), MatrixXd::Zero(200, 2), MatrixXd::Zero(200, 2), {}};
  path.q.col(1) = VectorXd::LinSpaced(200, 0, 2.5);
  const std::vector<Band> bands = bands_along(model, path, {}, 0.1);
  ASSERT_EQ(bands.size(), 2U);
  for (const double bend : {0.0, 0.9, 1.7, 2.5}) {
    const std::vector<Mode> modes = vibration_modes(model, VectorXd{{0, bend}}, {});
    for (std::size_t i = 0; i < 2; ++i) {
      const double f = std::min(modes[i].frequency_hz, 4 * bands[0].low_hz / 0.9);
      EXPECT_GT(1.02 * f, bands[i].low_hz / 0.9) << bend;
      EXPECT_LT(0.98 * f, bands[i].high_hz / 1.1) << bend;
    }
  }
  // from the stretched to the folded arm the first gear's mode gets faster
  EXPECT_GT(bands[0].high_hz / 1.1, 1.5 * bands[0].low_hz / 0.9);
}

}  // namespace
}  // namespace fxdyn
