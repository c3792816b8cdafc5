#include "host_tools/vibration/motor_reference.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <gtest/gtest.h>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/simulate/mujoco_plant.hpp"
#include "host_tools/vibration/moves.hpp"
#include "tests/simulate/support.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double mass = 5, lever = 0.3, tensor = 0.05, compliance = 3e-4, relaxation = 1e-3;
constexpr double inertia = tensor + mass * lever * lever;  // 13 Hz on its gear

/// A horizontal axis with a lever on an elastic gear.
IdentifiedModel lever_arm() {
  Robot robot;
  Joint joint;
  joint.name = "lever";
  joint.type = JointType::revolute;
  joint.origin = Eigen::Isometry3d::Identity();
  joint.axis = -Eigen::Vector3d::UnitY();
  Inertial body;
  body.mass = mass;
  body.centre = {lever, 0, 0};
  body.tensor = tensor * Eigen::Matrix3d::Identity();
  joint.inertial = body;
  robot.joints = {joint};
  robot.gravity = {0, 0, -9.81};
  IdentifiedModel model = test::plant_of(robot);
  JointFit& fit = model.joints[0];
  fit.effects = {test::effect("rotor_inertia", {}, {0.6}), test::effect("viscous", {}, {2}),
                 test::effect("elasticity", {relaxation}, {compliance})};
  fit.q_lower = -1.2;
  fit.q_upper = 1.2;
  fit.dq_limit = 2;
  fit.ddq_limit = 8;
  fit.rated_torque = 50;
  return model;
}

void expect_equal(const Reference& a, const Reference& b) {
  EXPECT_EQ(a.q, b.q);
  EXPECT_EQ(a.dq, b.dq);
  EXPECT_EQ(a.ddq, b.ddq);
  EXPECT_EQ(a.step_s, b.step_s);
}

TEST(MotorReference, WithoutElasticityItIsTheLinks) {
  const IdentifiedModel robot = test::puma_with_friction();
  const Reference links = test::motion_of(robot.robot, 0.002, 2);
  EXPECT_FALSE(bends(robot));
  expect_equal(motor_reference(robot, links), links);
}

TEST(MotorReference, IsAheadByWhatTheLoadBends) {
  const IdentifiedModel model = lever_arm();
  ASSERT_TRUE(bends(model));
  const Reference links = test::motion_of(model.robot, 0.0005, 5);
  const Reference motors = motor_reference(model, links);
  // K delta + B d(delta)/dt = load: the load a relaxation ago, to the first order
  const VectorXd load = inertia * links.ddq.col(0).array() + mass * lever * 9.81 * links.q.col(0).array().cos();
  const auto late = static_cast<Index>(std::lround(relaxation / links.step_s));
  const Index n = load.size() - late - 200;
  const VectorXd delta = (motors.q - links.q).col(0).segment(200, n);
  const VectorXd expected = compliance * load.segment(200 - late, n);
  EXPECT_GT(delta.cwiseAbs().maxCoeff(), 3e-3);
  EXPECT_LT((delta - expected).cwiseAbs().maxCoeff(), 0.002 * delta.cwiseAbs().maxCoeff());
}

TEST(MotorReference, VelocityAndAccelerationAreDerivatives) {
  const IdentifiedModel model = lever_arm();
  const Reference links = test::motion_of(model.robot, 0.0005, 5);
  const Reference motors = motor_reference(model, links);
  const Index inside = links.q.rows() - 2;
  const double h = links.step_s;
  const MatrixXd delta = motors.q - links.q, rate = motors.dq - links.dq, push = motors.ddq - links.ddq;
  const MatrixXd slope = (delta.bottomRows(inside) - delta.topRows(inside)) / (2 * h);
  const MatrixXd turn = (rate.bottomRows(inside) - rate.topRows(inside)) / (2 * h);
  const auto error = [&](const MatrixXd& a, const MatrixXd& b) {
    const auto inner = Eigen::seq(20, inside - 20);
    return test::rms(a(inner, 0) - b(inner, 0)) / test::rms(b(inner, 0));
  };
  EXPECT_LT(error(slope, rate.middleRows(1, inside)), 1e-3);
  EXPECT_LT(error(turn, push.middleRows(1, inside)), 1e-3);
}

TEST(MotorReference, EncoderErrorsAreIteratedToTheEnd) {
  IdentifiedModel model = lever_arm();
  const EffectFit runout = test::effect("eccentricity", {}, {0.08, -0.06});
  model.joints[0].effects.push_back(runout);
  const Reference links = test::motion_of(model.robot, 0.002, 5);
  const VectorXd q = motor_reference(model, links).q.col(0);
  const VectorXd elastic = (motor_reference(lever_arm(), links).q - links.q).col(0);
  const VectorXd shown = 0.08 * q.array().sin() - 0.06 * q.array().cos();
  EXPECT_LT((q - links.q.col(0) - elastic - shown).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(MotorReference, StaysSmoothWhereTheJerkJumps) {
  const IdentifiedModel model = lever_arm();
  for (const Move& move : make_moves(model, 0.002, 3, 1)) {
    // d(delta)/dt jumps by compliance inertia jerk there: within one tick that would be an acceleration of
    const MatrixXd& ddq = move.reference.ddq;
    const double jerk = (ddq(move.start + 1, 0) - ddq(move.start, 0)) / 0.002;
    const double jump = compliance * inertia * std::fabs(jerk) / 0.002;
    const MatrixXd more = motor_reference(model, move.reference).ddq - ddq;
    EXPECT_LT(more.middleRows(move.start - 20, 40).cwiseAbs().maxCoeff(), 0.2 * jump) << move.kind;
  }
}

/// Of the link: RMS error while it moves, and how far it swings at most after the stop [rad].
struct Loop {
  double tracking, residual;
};
Loop play(const Move& move, const Reference& asked) {
  const IdentifiedModel model = lever_arm();
  Reference reference = asked;
  reference.feedforward = predict(model, asked.q, asked.dq, asked.ddq, asked.step_s);
  ClosedLoopSettings settings;
  settings.bandwidth_hz = 24;
  settings.damping = 0.5;
  const PlantRun run = closed_loop_on_mujoco(model, reference, settings);
  const MatrixXd link = run.q - run.deflections;
  const MatrixXd error = (link - move.reference.q).middleRows(move.start, move.stop - move.start);
  const MatrixXd after = link.bottomRows(link.rows() - move.stop);
  return {test::rms(error), (after.array() - link.bottomRows(50).mean()).abs().maxCoeff()};
}

TEST(MotorReference, TheLinkFollowsAndStops) {
  for (const Move& move : make_moves(lever_arm(), 0.002, 3, 1)) {
    const Loop links = play(move, move.reference), motors = play(move, motor_reference(lever_arm(), move.reference));
    EXPECT_LT(motors.tracking, 0.1 * links.tracking) << move.kind;
    EXPECT_LT(motors.residual, 0.3 * links.residual) << move.kind;
  }
}

}  // namespace
}  // namespace fxdyn
