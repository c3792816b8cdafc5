// A BLS beside the effects of a diagnosed model, or that model as it was.

#include "host_tools/pipeline/training.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tests/support/small_project.hpp"

namespace fxdyn {
namespace {

std::vector<EffectFit> friction() {
  return {test::effect_fit("viscous", {}, {1.5}), test::effect_fit("coulomb", {}, {2})};
}

/// A project without training, its data, and the model that the diagnosis would hand over: a fit of them.
struct Work {
  Project project;
  GateData data;
  IdentifiedModel diagnosed;
  std::vector<std::string> asked;    ///< stages whose errors were asked for
  std::vector<std::size_t> effects;  ///< of joint 1 in those models

  Work(const IdentifiedModel& plant, std::vector<Log> logs, const std::vector<EffectFit>& known)
      : project(test::small_project("training", plant.robot, logs)), data(test::small_gate_data(std::move(logs))) {
    project.train.enabled = false;
    project.identify.physical = false;
    Fitter fitter(plant.robot, data.logs, test::design_of(test::model_of(plant.robot, known)));
    fitter.reweight();
    diagnosed = finish_model(fitter, project, data).model;
    diagnosed.stage = "diagnosed";
  }
  Training run() {
    Progress progress;
    ResumeFile none;
    return Trainer(project, data, diagnosed, errors(), progress).run(none);
  }
  Trainer::ErrorsOf errors() {
    return [this](const IdentifiedModel& model, const std::string& stage) {
      asked.push_back(stage);
      effects.push_back(model.joints[0].effects.size());
      StageErrors out{stage, {}};
      for (const ProcessedLog& log : data.logs) out.logs.push_back(errors_of(log, model.robot, predict(model, log)));
      return out;
    };
  }
};

double viscous_of(const IdentifiedModel& model) { return model.joints[0].find("viscous")->linear[0]; }

TEST(Training, ABetterFitTakesTheModelsPlace) {
  const IdentifiedModel plant = test::model_of(test::pendulum(), friction());
  Work work(plant, test::train_and_validate(plant, 0.01), friction());
  work.diagnosed.joints[0].effects[0].linear[0] = 1.2;
  const Training training = work.run();
  EXPECT_NEAR(viscous_of(training.model), 1.5, 0.01);
  EXPECT_EQ(training.model.stage, "trained");
  EXPECT_TRUE(training.outcomes.empty());
  EXPECT_EQ(work.asked, (std::vector<std::string>{"rigid", "diagnosed", "bls"}));
  EXPECT_EQ(work.effects, (std::vector<std::size_t>{0, 2, 2}));
  EXPECT_LT(validation_error(training.trained), validation_error(training.rigid));
  // Where an update goes on: at this model.
  EXPECT_LT((training.stored.information.solve() - coefficients_of(training.model, training.model.joints)).norm(),
            1e-6);
}

TEST(Training, ANewFitMovesTheShapesToo) {
  std::vector<EffectFit> effects = friction();
  effects.push_back(test::effect_fit("stribeck", {0.3}, {3}));
  const IdentifiedModel plant = test::model_of(test::pendulum(), effects);
  effects.back().shape[0] = 0.45;  // as diagnosis may leave it, without what a prior knows
  Work work(plant, test::train_and_validate(plant, 0.01), effects);
  const Training training = work.run();
  EXPECT_NEAR(training.model.joints[0].find("stribeck")->shape[0], 0.3, 0.006);
  EXPECT_LT(validation_error(training.trained), 0.5 * validation_error(work.errors()(work.diagnosed, "before")));
}

TEST(Training, AModelThatTheTrainLogsWouldSpoilStays) {
  const IdentifiedModel plant = test::model_of(test::pendulum(), friction());
  std::vector<EffectFit> warm = friction();
  warm[0].linear[0] = 2.5;
  std::vector<Log> logs = test::train_and_validate(plant, 0.01);
  logs[0] = test::exact_log(test::model_of(test::pendulum(), warm), Role::train, 1);
  Work work(plant, std::move(logs), friction());
  work.diagnosed.joints[0].effects[0].linear[0] = 1.5;  // as a baseline taught
  const Training training = work.run();
  EXPECT_EQ(viscous_of(training.model), 1.5);
  EXPECT_NEAR(viscous_of(training.estimate.model), 2.5, 0.01);  // the new fit is told all the same
  const auto& notes = training.model.notes;
  EXPECT_TRUE(std::any_of(notes.begin(), notes.end(), [](const std::string& note) {
    return note.find("the diagnosed model stays as it was") != std::string::npos;
  }));
  EXPECT_EQ(training.model.stage, "trained");
  EXPECT_LT((training.stored.information.solve() - coefficients_of(training.model, training.model.joints)).norm(),
            1e-6);
}

TEST(Training, ARefusedFitLeavesNoShapesBehind) {
  std::vector<EffectFit> effects = friction(), warm = friction();
  effects.push_back(test::effect_fit("stribeck", {0.3}, {3}));
  warm.push_back(test::effect_fit("stribeck", {0.6}, {3}));
  const IdentifiedModel plant = test::model_of(test::pendulum(), effects);
  std::vector<Log> logs = test::train_and_validate(plant, 0.01);
  logs[0] = test::exact_log(test::model_of(test::pendulum(), warm), Role::train, 1);
  Work work(plant, std::move(logs), effects);
  work.diagnosed = Work(plant, test::train_and_validate(plant, 0.01), effects).diagnosed;
  Progress progress;
  ResumeFile none;
  Trainer trainer(work.project, work.data, work.diagnosed, work.errors(), progress);
  const Training training = trainer.run(none);
  EXPECT_EQ(training.model.joints[0].find("stribeck")->shape[0], 0.3);
  EXPECT_EQ(trainer.fitter().design(0).find("stribeck")->shape[0], 0.3);
  EXPECT_EQ(trainer.fitter().design(0).sign_width, work.diagnosed.joints[0].sign_width);
}

TEST(Training, ABlsLearnsWhatNoEffectExplains) {
  std::vector<EffectFit> effects = friction();
  effects.push_back(test::effect_fit("stribeck", {0.3}, {3}));
  const IdentifiedModel plant = test::model_of(test::pendulum(), effects);
  Work work(plant, test::train_and_validate(plant, 0.01), friction());
  work.project.train.enabled = true;
  work.project.train.nodes = 8;
  const Training training = work.run();
  ASSERT_EQ(training.outcomes.size(), 1U);
  EXPECT_TRUE(training.outcomes[0].kept);
  EXPECT_LT(training.outcomes[0].error_with, 0.5 * training.outcomes[0].error_without);
  EXPECT_TRUE(training.model.joints[0].bls);
  const TrainedJoint joint = trained_joints(training.outcomes, plant.robot).at(0);
  EXPECT_EQ(joint.joint, "joint_1");
  EXPECT_EQ(joint.held_out_with, training.outcomes[0].error_with);
  EXPECT_TRUE(joint.kept);
  EXPECT_EQ(joint.choice->nodes, training.outcomes[0].shape.nodes);
}

/// Two joints with friction, of which only the first one's has a minimum that the diagnosed model does not know.
IdentifiedModel one_unknown() {
  IdentifiedModel plant = test::model_of(test::pendulum(2), friction());
  plant.joints[0].effects.push_back(test::effect_fit("stribeck", {0.3}, {3}));
  return plant;
}

TEST(Training, AJointThatKeepsNoBlsStaysAsItWas) {
  const IdentifiedModel plant = one_unknown();
  Work work(plant, test::train_and_validate(plant, 0.01), friction());
  work.project.train.enabled = true;
  work.project.train.nodes = 8;
  const Training training = work.run();
  ASSERT_TRUE(training.outcomes[0].kept);
  ASSERT_FALSE(training.outcomes[1].kept);
  const ProcessedLog& validate = work.data.logs[1];
  const Eigen::MatrixXd before = predict(work.diagnosed, validate), after = predict(training.model, validate);
  EXPECT_TRUE(before.col(1) == after.col(1));
  EXPECT_GT((before.col(0) - after.col(0)).norm(), 0.03 * before.col(0).norm());
  const auto &known = training.gate_errors[1], &learned = training.gate_errors[0];
  EXPECT_EQ(known.exported, "diagnosed");
  EXPECT_EQ(known.bls, known.diagnosed);
  EXPECT_EQ(learned.exported, "bls");
  EXPECT_LT(learned.bls, 0.5 * learned.diagnosed);
  // What is told is of the model as it is exported.
  EXPECT_EQ(learned.bls, pooled_error(training.trained.logs, Role::validate, 0).rmse);
  EXPECT_EQ(learned.bls, judge(validate, after)[0].rmse);
  EXPECT_EQ(static_cast<std::size_t>(training.stored.information.solve().size()), training.stored.unknowns.size());
}

TEST(Training, ABlsIsNotKeptThatIsBetterThanItsOwnFitAloneAndWorseThanTheDiagnosedModel) {
  // The train log is of a warm robot; a baseline taught the diagnosed model what holds on the validate log.
  std::vector<EffectFit> effects = friction();
  effects.push_back(test::effect_fit("stribeck", {0.3}, {2.5}));
  const IdentifiedModel plant = test::model_of(test::pendulum(), effects);
  std::vector<EffectFit> warm = effects;
  warm[0].linear[0] = 2.5;
  std::vector<Log> logs = test::train_and_validate(plant, 0.01);
  logs[0] = test::exact_log(test::model_of(test::pendulum(), warm), Role::train, 1);
  Work work(plant, std::move(logs), friction());
  work.diagnosed = Work(plant, test::train_and_validate(plant, 0.01), friction()).diagnosed;
  work.project.train.enabled = true;
  work.project.train.nodes = 8;
  const Training training = work.run();
  const TrainOutcome& outcome = training.outcomes[0];
  ASSERT_TRUE(outcome.bls);
  EXPECT_FALSE(outcome.kept);
  EXPECT_GT(outcome.error_with, outcome.error_without);
  EXPECT_FALSE(training.model.joints[0].bls);
  EXPECT_TRUE(predict(training.model, work.data.logs[1]) == predict(work.diagnosed, work.data.logs[1]));
  EXPECT_EQ(training.gate_errors[0].exported, "diagnosed");
  const std::string notes = fmt::format("{}", fmt::join(training.model.notes, "; "));
  EXPECT_NE(notes.find("no BLS on joint_1"), std::string::npos) << notes;
}

TEST(Training, TestLogsChooseNothing) {
  const IdentifiedModel plant = one_unknown();
  IdentifiedModel models[2];
  for (const bool loaded : {false, true}) {
    std::vector<Log> logs = test::train_and_validate(plant, 0.01);
    Work work(plant, std::move(logs), friction());
    work.project.train.enabled = true;
    work.project.train.nodes = 8;
    // Errors on a test log are asked for and shown, whatever they are.
    const auto of_gate = work.errors();
    const Trainer::ErrorsOf with_test = [&](const IdentifiedModel& model, const std::string& stage) {
      StageErrors out = of_gate(model, stage);
      out.logs.push_back(out.logs.back());
      out.logs.back().role = Role::test;
      for (auto& joint : out.logs.back().joints) joint.metrics.rmse = loaded && stage == "bls" ? 1e3 : 1e-3;
      return out;
    };
    Progress progress;
    ResumeFile none;
    models[loaded] = Trainer(work.project, work.data, work.diagnosed, with_test, progress).run(none).model;
  }
  EXPECT_EQ(to_json(models[0]), to_json(models[1]));
}

TEST(Training, RigidErrorsAreOfTheBodiesAlone) {
  const IdentifiedModel plant = test::model_of(test::pendulum(), friction());
  Work work(plant, test::train_and_validate(plant, 0), friction());
  const Fitter fitter(plant.robot, work.data.logs, test::design_of(plant));
  const StageErrors rigid = rigid_errors(fitter, work.project, work.data.filter, work.errors());
  EXPECT_EQ(rigid.stage, "rigid");
  EXPECT_EQ(work.effects, (std::vector<std::size_t>{0}));
  // Friction of 2 N*m and more is missing.
  EXPECT_GT(rigid.logs[1].joints[0].metrics.rmse, 1);
  EXPECT_EQ(fitter.design(0).effects.size(), 2U);  // the fitter itself stays
}

TEST(Training, SettingsThatOthersLeaveWithoutEffectAreNamed) {
  TrainSettings settings;
  EXPECT_EQ(unused_settings(settings), "");
  settings.windows = 2;
  EXPECT_EQ(unused_settings(settings),
            "train.windows: not used, the number of nodes is searched; give nodes too to set it");
  settings.nodes = 4;
  EXPECT_EQ(unused_settings(settings), "");
  settings.enhancement = 10;
  EXPECT_EQ(unused_settings(settings), "train.windows, nodes: not used, enhancement says how many nodes there are");
  settings.features = "sparse";
  EXPECT_EQ(unused_settings(settings), "");
  settings.pso = PsoSettings{};
  settings.ridge = 1e-3;
  EXPECT_EQ(unused_settings(settings),
            "train.enhancement, ridge: not used, the swarm of [train.pso] chooses within its bounds");
  settings.enabled = false;
  EXPECT_EQ(unused_settings(settings), "");
}

}  // namespace
}  // namespace fxdyn
