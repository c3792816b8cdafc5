// Parameters by simulated positions: friction that the model lacks, an exact model, what runs away, what the gate
// keeps.

#include "host_tools/forward/refine.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "host_tools/simulate/closed_loop.hpp"
#include "tests/simulate/support.hpp"
#include "tests/support/pendulum.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double step_s = 0.004;
constexpr Index given = 20;

/// A horizontal slide of 4 kg with viscous and Coulomb friction.
IdentifiedModel slide() {
  const std::string urdf =
      "<robot name=\"slide\"><link name=\"base\"/><link name=\"car\"><inertial><mass value=\"4\"/><inertia ixx=\"1\" "
      "ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link><joint name=\"x\" type=\"prismatic\">"
      "<parent link=\"base\"/><child link=\"car\"/><axis xyz=\"1 0 0\"/><limit lower=\"-9\" upper=\"9\" "
      "velocity=\"9\" effort=\"99\"/></joint></robot>";
  IdentifiedModel model = test::plant_of(read_urdf(test::write("slide.urdf", urdf)));
  model.joints[0].sign_width = 0.01;
  model.joints[0].effects = {test::effect("viscous", {}, {10}), test::effect("coulomb", {}, {3})};
  model.base.push_back({0, "m1", 4, 0, true, "m1"});
  model.filter = test::filter_of(60, 30, 0.1);
  return model;
}

IdentifiedModel with_stribeck(IdentifiedModel model) {
  model.joints[0].effects.push_back(test::effect("stribeck", {0.05}, {4}));
  return model;
}

/// What the truth does under two sines of force.
ForwardLog driven(const IdentifiedModel& truth, const IdentifiedModel& model, double slow, double fast,
                  const std::string& name) {
  Log log;
  log.file = name;
  log.step_s = step_s;
  const Index samples = 3000;
  log.t = VectorXd::LinSpaced(samples, 0, step_s * static_cast<double>(samples - 1));
  log.to_s = step_s * static_cast<double>(samples);
  log.tau = (14 * (slow * log.t.array()).sin() + 8 * (fast * log.t.array() + 1).sin()).matrix();
  const VectorXd rest = VectorXd::Zero(1);
  log.q = run_open_loop(truth, {rest, rest, rest}, step_s, log.tau, 4, 0);
  ProcessedLog processed = process(log, model.filter);
  return {std::move(log), std::move(processed)};
}

/// The model with base parameters and coefficients by least squares on the torque.
IdentifiedModel by_torque(IdentifiedModel model, const ForwardLog& log) {
  const auto set = [&](const Eigen::Vector3d& x) {
    model.base[0].value = model.inertia[0].m = x[0];
    model.joints[0].effects[0].linear[0] = x[1];
    model.joints[0].effects[1].linear[0] = x[2];
  };
  const ProcessedLog& p = log.processed;
  const Index rows = p.last - p.first;
  MatrixXd columns(rows, 3);
  for (int k = 0; k < 3; ++k) {
    set(Eigen::Vector3d::Unit(k));
    columns.col(k) = p.filter_columns(predict(model, p)).middleRows(p.first, rows);
  }
  set(columns.householderQr().solve(p.filter_columns(p.tau).middleRows(p.first, rows)));
  return model;
}

double open_rmse(const IdentifiedModel& model, const ForwardLog& log) {
  return simulate_forward(model, log.raw, log.processed, given).open.rmse[0];
}

TEST(Refine, FrictionThatTheModelLacksIsMadeUpForOnAnotherMotion) {
  const IdentifiedModel plain = slide(), truth = with_stribeck(plain);
  const ForwardLog train = driven(truth, plain, 1.3, 4.1, "train.csv"),
                   validate = driven(truth, plain, 1.1, 3.7, "validate.csv"),
                   test = driven(truth, plain, 1.7, 5.3, "test.csv");
  const IdentifiedModel start = by_torque(plain, train);
  Progress progress;
  const Refinement refined = refine(start, {train}, {validate}, given, progress);
  EXPECT_EQ(refined.loop, Loop::open);
  for (const TriedWeight& tried : refined.tried) EXPECT_LT(tried.held_out, 1) << tried.weight;
  ASSERT_TRUE(refined.kept) << open_rmse(start, train) << " " << open_rmse(start, test);
  EXPECT_LT(refined.after[0], 0.85 * refined.before[0]);                     // 22 and 26 mm
  EXPECT_LT(open_rmse(refined.model, test), 0.85 * open_rmse(start, test));  // 45 and 59 mm
  EXPECT_EQ(refined.model.base[0].value, refined.model.inertia[0].m);
  ASSERT_EQ(refined.parameters.size(), 3);
  EXPECT_EQ(refined.parameters[1].name, "x: viscous coefficient");
  EXPECT_EQ(refined.parameters[1].unit, "N*s/m");
  EXPECT_EQ(refined.parameters[1].after, refined.model.joints[0].effects[0].linear[0]);
}

TEST(Refine, TheTruthIsFoundFromWrongParameters) {
  const IdentifiedModel truth = slide();
  const ForwardLog train = driven(truth, truth, 1.3, 4.1, "train.csv"),
                   validate = driven(truth, truth, 1.1, 3.7, "validate.csv");
  IdentifiedModel start = truth;
  start.base[0].value = start.inertia[0].m = 4.4;
  start.joints[0].effects[0].linear[0] = 9;
  start.joints[0].effects[1].linear[0] = 3.5;
  Progress progress;
  const Refinement refined = refine(start, {train}, {validate}, given, progress);
  EXPECT_NEAR(refined.parameters[0].after, 4, 0.04);
  EXPECT_NEAR(refined.parameters[1].after, 10, 0.1);
  EXPECT_NEAR(refined.parameters[2].after, 3, 0.03);
  EXPECT_LT(refined.after[0], 0.1 * refined.before[0]);
}

TEST(Refine, ValidateLogsThatDisagreeKeepTheFitByTorque) {
  const IdentifiedModel plain = slide(), truth = with_stribeck(plain);
  const ForwardLog train = driven(truth, plain, 1.3, 4.1, "train.csv");
  // A robot for which the fit by torque is exact: what simulation finds is worse there.
  const ForwardLog validate = driven(by_torque(plain, train), plain, 1.1, 3.7, "validate.csv");
  Progress progress;
  const IdentifiedModel start = by_torque(plain, train);
  const Refinement refined = refine(start, {train}, {validate}, given, progress);
  EXPECT_FALSE(refined.kept);
  EXPECT_EQ(refined.model.base[0].value, start.base[0].value);
  EXPECT_EQ(refined.model.joints[0].effects[1].linear[0], start.joints[0].effects[1].linear[0]);
  for (const TriedWeight& tried : refined.tried) EXPECT_GT(tried.held_out, 1);
}

TEST(Refine, ARobotThatRunsAwayIsRefinedInClosedLoop) {
  // Two links about the upright: a torque that is off by a little lets them fall.
  IdentifiedModel truth = test::model_of(test::pendulum(2), {test::effect("viscous", {}, {0.3})});
  truth.filter = test::small_filter(2);
  Log log = test::exact_log(truth, Role::train, 3, 8);
  log.dq.resize(0, 0);
  log.ddq.resize(0, 0);
  ProcessedLog processed = process(log, truth.filter);
  const ForwardLog train{std::move(log), std::move(processed)};
  IdentifiedModel start = truth;
  for (JointFit& joint : start.joints) joint.effects[0].linear[0] = 0.6;
  Progress progress;
  const Refinement refined = refine(start, {train}, {}, given, progress);
  EXPECT_EQ(refined.loop, Loop::closed) << refined.why_closed;
  EXPECT_NE(refined.why_closed, "");
  ASSERT_EQ(refined.parameters.size(), 2);  // this model names no base parameters: its links stay
  ASSERT_TRUE(refined.kept);
  EXPECT_LE(refined.after.sum(), 0.5 * refined.before.sum());
  EXPECT_NEAR(refined.parameters[0].after, 0.3, 0.05);
}

}  // namespace
}  // namespace fxdyn
