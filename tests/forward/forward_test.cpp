// Positions from torques: against a closed form, against MuJoCo, and what is refused.

#include "host_tools/forward/forward.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/simulate/mujoco_plant.hpp"
#include "tests/simulate/support.hpp"
#include "tests/support/filter.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr double step_s = 0.001;
constexpr double mass = 4, damping = 10;     // [kg], [N*s/m]
constexpr double force = 30, frequency = 3;  // [N], [rad/s]
constexpr Index given = 20;

/// A horizontal slide with viscous friction.
IdentifiedModel slide(double with_mass = mass) {
  const std::string urdf = fmt::format(
      "<robot name=\"slide\"><link name=\"base\"/><link name=\"car\"><inertial><mass value=\"{}\"/><inertia ixx=\"1\" "
      "ixy=\"0\" "
      "ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link><joint name=\"x\" type=\"prismatic\"><parent "
      "link=\"base\"/><child link=\"car\"/><axis xyz=\"1 0 0\"/><limit lower=\"-9\" upper=\"9\" velocity=\"9\" "
      "effort=\"99\"/></joint></robot>",
      with_mass);
  IdentifiedModel model = test::plant_of(read_urdf(test::write("slide.urdf", urdf)));
  model.joints[0].sign_width = 0.002;
  model.joints[0].effects = {test::effect("viscous", {}, {damping})};
  model.filter = test::filter_of(30, 30, 0.1);
  return model;
}

/// F sin(w t) from rest: m dv/dt + d v = F sin(w t) has a closed form.
Log driven_slide(double seconds = 4) {
  Log log;
  log.file = "slide.csv";
  log.role = Role::test;
  log.step_s = step_s;
  const auto samples = static_cast<Index>(seconds / step_s);
  log.t = Eigen::VectorXd::LinSpaced(samples, 0, step_s * static_cast<double>(samples - 1));
  log.to_s = seconds;
  const double w = frequency, scale = force / (damping * damping + mass * mass * w * w);
  log.q = (scale * (damping * (1 - (w * log.t.array()).cos()) / w - mass * (w * log.t.array()).sin() +
                    mass * mass * w / damping * (1 - (-damping / mass * log.t.array()).exp())))
              .matrix();
  log.tau = (force * (w * log.t.array()).sin()).matrix();
  return log;
}

Forward of(const IdentifiedModel& model, const Log& log, Index first = given) {
  return simulate_forward(model, log, process(log, model.filter), first);
}

TEST(Forward, TheRightModelFollowsTheClosedForm) {
  const Log log = driven_slide();
  const Forward forward = of(slide(), log);
  ASSERT_EQ(forward.open.why_failed, "");
  ASSERT_EQ(forward.closed.why_failed, "");
  // A parabola through a motion with a jerk J misses its speed at the end by J T^2 / 10, and the slide rolls on by that
  // times m / d. The motion covers 1.2 m.
  const double jerk = force * frequency / mass, start_s = step_s * static_cast<double>(given);
  EXPECT_LT(forward.open.rmse[0], 1.1 * jerk * start_s * start_s / 10 * mass / damping);
  EXPECT_LT(forward.closed.rmse[0], 1e-4);
  EXPECT_EQ(forward.open.q.topRows(given), log.q.topRows(given));
}

TEST(Forward, AWrongMassShowsMoreInOpenLoop) {
  const Forward forward = of(slide(1.2 * mass), driven_slide());
  EXPECT_GT(forward.open.rmse[0], 5e-3);
  EXPECT_GT(forward.closed.rmse[0], 1e-4);
  EXPECT_LT(forward.closed.rmse[0], 0.2 * forward.open.rmse[0]);
}

TEST(Forward, TheStartIsThatOfTheGivenSamples) {
  Log log = driven_slide();
  // Cut where the slide moves: without its speed at the start it would be off by 0.1 m after a second.
  const Index cut = 700, left = log.samples() - cut;
  log.q = log.q.bottomRows(left).eval();
  log.tau = log.tau.bottomRows(left).eval();
  log.t = log.t.head(left).eval();
  EXPECT_LT(of(slide(), log).open.rmse[0], 2e-3);
}

TEST(Forward, ARobotOfMuJoCoIsFollowedForASecond) {
  IdentifiedModel plant = test::puma_with_friction();
  for (JointFit& joint : plant.joints) joint.effects.clear();  // MuJoCo's rigid body alone
  plant.filter = test::filter_of(40, 40, 0.1);
  Reference reference = test::motion_of(plant.robot, 0.0005, 1);
  reference.feedforward = predict(plant, reference.q, reference.dq, reference.ddq, reference.step_s);
  const auto run = closed_loop_on_mujoco(plant, reference, {});
  Log log;
  log.file = "mujoco.csv";
  log.role = Role::test;
  log.step_s = reference.step_s;
  log.to_s = 1;
  log.t = Eigen::VectorXd::LinSpaced(run.q.rows(), 0, reference.step_s * static_cast<double>(run.q.rows() - 1));
  log.q = run.q;
  log.tau = run.tau;
  const Forward forward = of(plant, log);
  ASSERT_EQ(forward.open.why_failed, "");
  for (Index j = 0; j < 6; ++j) {
    const double range = log.q.col(j).maxCoeff() - log.q.col(j).minCoeff();
    EXPECT_LT(forward.open.rmse[j], 0.02 * range) << "joint " << j + 1;
  }
}

std::string complaint(const IdentifiedModel& model, const Log& log, Index first = given) {
  try {
    of(model, log, first);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "none";
}

TEST(Forward, SaysWhatIsWrongWithALog) {
  Log stuck = driven_slide();
  stuck.tau.middleRows(1000, 1500).setConstant(stuck.tau(1000, 0));
  EXPECT_NE(complaint(slide(), stuck).find("tau1 (x) stays at"), std::string::npos) << complaint(slide(), stuck);
  EXPECT_NE(complaint(slide(), driven_slide(), 2).find("at least 3 samples"), std::string::npos);
  EXPECT_NE(complaint(slide(), driven_slide(), 4000).find("nothing is left to simulate"), std::string::npos);
  Log opposite = driven_slide();
  opposite.tau *= -1;
  EXPECT_NE(complaint(slide(), opposite).find("explains the torque of no joint"), std::string::npos);
}

TEST(Forward, AModelThatIsNoPlantSaysSo) {
  IdentifiedModel model = slide(1);
  model.joints[0].effects.push_back(test::effect("rotor_inertia", {}, {-2}));
  const Forward forward = of(model, driven_slide());
  EXPECT_NE(forward.open.why_failed.find("not positive definite"), std::string::npos) << forward.open.why_failed;
  EXPECT_EQ(forward.open.q.size(), 0);
}

}  // namespace
}  // namespace fxdyn
