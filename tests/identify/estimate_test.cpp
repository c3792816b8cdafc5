// What a fit comes to: the model, and what it says of itself.

#include "host_tools/identify/estimate.hpp"

#include <gtest/gtest.h>

#include "host_tools/project/provenance.hpp"
#include "host_tools/support/error.hpp"
#include "tests/support/small_project.hpp"

namespace fxdyn {
namespace {

constexpr double viscous = 1.5, coulomb = 2;

IdentifiedModel plant_with(double viscous_friction) {
  return test::model_of(test::pendulum(2), {test::effect_fit("viscous", {}, {viscous_friction}),
                                            test::effect_fit("coulomb", {}, {coulomb})});
}

/// A fit of a plant's logs, and the project that would name them.
struct Fit {
  Project project;
  GateData data;
  Fitter fitter;

  explicit Fit(const IdentifiedModel& plant) : Fit(plant, test::train_and_validate(plant, 0.01)) {}
  Fit(const IdentifiedModel& plant, std::vector<Log> logs)
      : project(test::small_project("estimate", plant.robot, logs)),
        data(test::small_gate_data(std::move(logs))),
        fitter(plant.robot, data.logs, test::design_of(plant)) {
    project.target.tick_s = 0.001;
    project.train.seed = 7;
    data.notes = {"a note of the data"};
    fitter.reweight();
  }
  Fit(const Fit&) = delete;
  Estimate finish() const { return finish_model(fitter, project, data); }
};

TEST(Estimate, IsTheModelThatMadeTheData) {
  const IdentifiedModel plant = plant_with(viscous);
  Fit fit(plant);
  const Estimate estimate = fit.finish();
  for (const JointFit& joint : estimate.model.joints) {
    EXPECT_NEAR(joint.find("viscous")->linear[0], viscous, 0.005);
    EXPECT_NEAR(joint.find("coulomb")->linear[0], coulomb, 0.005);
    EXPECT_GT(joint.find("viscous")->linear_std[0], 0);
  }
  const ProcessedLog& log = fit.data.logs[1];
  EXPECT_LT((predict(estimate.model, log) - predict(plant, log)).norm(), 1e-3 * log.tau.norm());
  EXPECT_GE(estimate.condition, 1);
  EXPECT_LT(estimate.condition, 100);
  EXPECT_TRUE(estimate.weak.empty());
  EXPECT_FALSE(estimate.recursion);
  ASSERT_TRUE(estimate.physical);
  EXPECT_FALSE(estimate.physical->constrained);
}

TEST(Estimate, RecordsWhereItComesFrom) {
  Fit fit(plant_with(viscous));
  fit.fitter.set_torque_lead(0.001);
  const IdentifiedModel model = fit.finish().model;
  EXPECT_EQ(model.project, "estimate.toml");
  EXPECT_EQ(model.project_hash, project_hash(fit.project));
  EXPECT_EQ(model.seed, 7U);
  EXPECT_EQ(model.tick_s, 0.001);
  EXPECT_EQ(model.filter.torque_lead_s, 0.001);
  EXPECT_EQ(model.filter.torque_cutoff_hz, 12);
  ASSERT_EQ(model.logs.size(), 2U);
  EXPECT_EQ(model.logs[1].role, "validate");
  EXPECT_EQ(model.notes, (std::vector<std::string>{"a note of the data"}));
}

TEST(Estimate, LogsThatAreReadAlikeSayHowToReadOthers) {
  Fit fit(plant_with(viscous));
  for (LogEntry& entry : fit.project.logs) entry.format.torque_gain = {3, 4};
  auto formats = fit.finish().model.log_formats;
  ASSERT_EQ(formats.size(), 1U);
  EXPECT_EQ(formats.at("").torque_gain, (std::vector<double>{3, 4}));
  // Each its own: none of them says how to read others.
  fit.project.logs[1].format.torque_gain = {1, 1};
  fit.project.logs[1].scenario = "s.toml";
  fit.project.logs[1].scenario_log = "b";
  formats = fit.finish().model.log_formats;
  ASSERT_EQ(formats.size(), 2U);
  EXPECT_EQ(formats.at("log_1.csv").torque_gain, (std::vector<double>{3, 4}));
  EXPECT_EQ(formats.at("b.csv").torque_gain, (std::vector<double>{1, 1}));
}

TEST(Estimate, RecursionThatForgetsNothingEndsAtTheFit) {
  Fit fit(plant_with(viscous));
  const IdentifiedModel batch = fit.finish().model;
  fit.project.identify.method = "rls";
  const Estimate recursive = fit.finish();
  ASSERT_TRUE(recursive.recursion);
  EXPECT_EQ(recursive.recursion->trace.rows(), 200);
  ASSERT_EQ(recursive.model.base.size(), batch.base.size());
  for (std::size_t k = 0; k < batch.base.size(); ++k)
    EXPECT_NEAR(recursive.model.base[k].value, batch.base[k].value, 1e-6 * (1 + std::fabs(batch.base[k].value)));
}

TEST(Estimate, FrictionThatDrivesIsNotPossible) {
  Fit fit(plant_with(-0.5));
  fit.project.identify.physical = false;
  const Estimate free = fit.finish();
  EXPECT_FALSE(free.physical);
  EXPECT_NEAR(free.model.joints[0].find("viscous")->linear[0], -0.5, 0.005);
  fit.project.identify.physical = true;
  const Estimate possible = fit.finish();
  ASSERT_TRUE(possible.physical && possible.physical->constrained);
  for (const JointFit& joint : possible.model.joints) EXPECT_GE(joint.find("viscous")->linear[0], 0);
}

/// Two slides along one line, the second driven so that its link stands still: nothing shows its mass.
Fit standing_still() {
  Robot robot = test::pendulum(2);
  robot.gravity.setZero();
  for (Joint& joint : robot.joints) {
    joint.type = JointType::prismatic;
    joint.origin.translation().setZero();
    joint.axis = Eigen::Vector3d::UnitZ();
  }
  const IdentifiedModel plant = test::model_of(robot, {test::effect_fit("viscous", {}, {viscous})});
  Log log = test::exact_log(plant, Role::train, 1);
  log.q.col(1) = -log.q.col(0);
  log.dq.col(1) = -log.dq.col(0);
  log.ddq.col(1) = -log.ddq.col(0);
  log.tau = predict(plant, log.q, log.dq, log.ddq, log.step_s);
  test::add_torque_noise(log, 0.01, 1);
  return {plant, std::vector<Log>{log}};
}

TEST(Estimate, WhatTheLogsDoNotTellIsNamed) {
  Fit fit = standing_still();
  fit.project.identify.physical = false;
  std::string message;
  try {
    fit.finish();
  } catch (const DataError& error) {
    message = error.what();
  }
  EXPECT_EQ(message.rfind("the train logs can't tell m2: record a log in which joint ", 0), 0U) << message;
}

}  // namespace
}  // namespace fxdyn
