#include "host_tools/simulate/closed_loop.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <gtest/gtest.h>

#include <chrono>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/simulate/mujoco_plant.hpp"
#include "tests/simulate/support.hpp"
#include "tests/support/sanitizers.hpp"

namespace fxdyn {
namespace {

using Eigen::MatrixXd;

IdentifiedModel without_effects(IdentifiedModel plant) {
  for (JointFit& joint : plant.joints) joint.effects.clear();
  return plant;
}

/// With the torque of the rigid body and its rotors along the way.
Reference with_feedforward(const IdentifiedModel& plant, Reference reference) {
  IdentifiedModel known = plant;
  for (JointFit& joint : known.joints)
    std::erase_if(joint.effects, [](const EffectFit& fit) { return fit.effect != "rotor_inertia"; });
  reference.feedforward = predict(known, reference.q, reference.dq, reference.ddq, reference.step_s);
  return reference;
}

TEST(ClosedLoop, FollowsTheReference) {
  const IdentifiedModel plant = test::puma_with_friction();
  const Reference reference = with_feedforward(plant, test::motion_of(plant.robot, 0.002, 10));
  const ClosedLoopRun run = run_closed_loop(plant, reference, {});
  // friction is not fed forward: a load of coulomb + viscous speed bends the loop by its size over kp
  EXPECT_LT((run.q - reference.q).cwiseAbs().maxCoeff(), 0.02);
  EXPECT_LT(test::rms(run.q - reference.q), 0.006);
  ClosedLoopSettings stiff;
  stiff.bandwidth_hz = 20;
  stiff.substeps = 8;
  EXPECT_LT(test::rms(run_closed_loop(plant, reference, stiff).q - reference.q), 0.0008);
}

TEST(ClosedLoop, VelocityAndAccelerationAreDerivativesOfThePosition) {
  const IdentifiedModel plant = test::puma_with_friction();
  const Reference reference = with_feedforward(plant, test::motion_of(plant.robot, 0.0005, 5));
  ClosedLoopSettings settings;
  settings.substeps = 1;
  settings.hold = 4;
  const ClosedLoopRun run = run_closed_loop(plant, reference, settings);
  const Eigen::Index last = run.q.rows() - 1;
  MatrixXd dq = MatrixXd::Zero(last + 1, 6), ddq = dq;
  dq.middleRows(1, last - 1) = (run.q.bottomRows(last - 1) - run.q.topRows(last - 1)) / 0.001;
  ddq.middleRows(1, last - 1) = (run.dq.bottomRows(last - 1) - run.dq.topRows(last - 1)) / 0.001;
  EXPECT_LT((ddq - run.ddq).middleRows(1, last - 1).cwiseAbs().maxCoeff(), 1e-8);
  // the acceleration jumps within the span of the difference: a quarter of the jump times the step
  EXPECT_LT(test::rms((dq - run.dq).middleRows(1, last - 1)), 2e-4 * test::rms(run.dq));
}

TEST(ClosedLoop, AppliedTorqueIsThatOfTheModelOnItsMotion) {
  IdentifiedModel plant = test::puma_with_friction();
  plant.joints[0].effects.push_back(test::effect("stribeck", {0.08}, {2.5}));
  plant.joints[1].effects.push_back(test::effect("presliding", {0.002}, {10.6}));
  plant.joints[2].effects.push_back(test::effect("load_friction", {}, {0.1}));
  plant.joints[3].effects.push_back(test::effect("joint_coupling", {5}, {0.5, 0.2}));
  plant.joints[4].effects.push_back(test::effect("motor_coupling", {6, 1.0, 0.01}, {0.5, 0.1, 0.02}));
  plant.joints[5].effects.push_back(test::effect("motor_coupling", {5, 1.0, 0.01}, {0.5, 0.1, 0.02}));
  plant.joints[5].effects.push_back(test::effect("friction_drift", {20}, {0.4, 0.1}));
  plant.body.push_back(test::effect("payload", {}, {2.0, 0.0, 0.05, 0.1}));
  const Reference reference = with_feedforward(plant, test::motion_of(plant.robot, 0.0005, 10));
  ClosedLoopSettings settings;
  settings.substeps = 1;
  settings.hold = 4;
  settings.age_s = 15;
  const ClosedLoopRun run = run_closed_loop(plant, reference, settings);
  const MatrixXd model = predict(plant, run.q, run.dq, run.ddq, reference.step_s, nullptr, 15);
  // What the controller applied has jumps, and friction is taken at the ends of the steps; over 20 ms it is the same.
  const ZeroPhaseFilter filter(20, reference.step_s);
  const MatrixXd applied = filter.apply(run.tau), expected = filter.apply(model);
  for (Eigen::Index j = 0; j < 6; ++j) {
    const double error = test::rms(applied.col(j) - expected.col(j));
    EXPECT_LT(error, 0.01 * test::rms(expected.col(j))) << "joint " << j + 1;
  }
}

TEST(ClosedLoop, RigidBodyMovesAsMuJoCos) {
  // Open loop but for a weak controller: errors of the dynamics add up.
  std::vector<IdentifiedModel> plants{without_effects(test::puma_with_friction())};
  for (unsigned seed = 1; plants.size() < 4; ++seed) {
    const Robot robot = test::Chains(seed).robot(4);
    if (test::slides(robot)) plants.push_back(test::plant_of(robot));
  }
  for (const IdentifiedModel& plant : plants) {
    Reference reference = test::motion_of(plant.robot, 0.0005, 3);
    reference.feedforward = 0.7 * predict(plant, reference.q, reference.dq, reference.ddq, reference.step_s);
    ClosedLoopSettings settings;
    settings.bandwidth_hz = 1;
    const MatrixXd ours = run_closed_loop(plant, reference, settings).q;
    const MatrixXd theirs = closed_loop_on_mujoco(plant, reference, settings).q;
    EXPECT_GT(test::rms(ours - reference.q), 0.02) << "the controller holds the robot, so nothing is compared";
    // theirs is of first order in its step of 0.125 ms
    EXPECT_LT(test::rms(ours - theirs), 0.001 * test::rms(ours - reference.q));
  }
}

TEST(ClosedLoop, StepSizeDoesNotMatter) {
  const IdentifiedModel plant = test::puma_with_friction();
  const Reference reference = with_feedforward(plant, test::motion_of(plant.robot, 0.002, 5));
  ClosedLoopSettings coarse, fine;
  fine.substeps = 32;
  const ClosedLoopRun a = run_closed_loop(plant, reference, coarse), b = run_closed_loop(plant, reference, fine);
  EXPECT_LT(test::rms(a.q - b.q), 0.005 * test::rms(b.q - reference.q));
}

TEST(ClosedLoop, AModelThatCantMoveIsRefused) {
  IdentifiedModel plant = test::plant_of(read_urdf(test::puma560));
  plant.inertia[5].xx = plant.inertia[5].yy = -1;
  const Reference reference = test::motion_of(plant.robot, 0.002, 0.1);
  EXPECT_THROW(run_closed_loop(plant, reference, {}), DataError);
}

TEST(ClosedLoop, FortySecondsOfAnArmTakeSeconds) {
  if (test::sanitized) GTEST_SKIP() << "a matter of speed";
  const IdentifiedModel plant = test::puma_with_friction();
  const Reference reference = with_feedforward(plant, test::motion_of(plant.robot, 0.002, 40));
  const auto start = std::chrono::steady_clock::now();
  run_closed_loop(plant, reference, {});
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  RecordProperty("seconds", std::to_string(took.count()));
  EXPECT_LT(took.count(), 6) << "on a busy machine; alone it takes a fraction";
}

}  // namespace
}  // namespace fxdyn
