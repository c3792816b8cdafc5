// Possible bodies around a model that was found, and coefficients of a joint beside base parameters that stay.

#include "host_tools/pipeline/possible_model.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "host_tools/identify/estimate.hpp"
#include "tests/support/small_project.hpp"

namespace fxdyn {
namespace {

std::vector<EffectFit> friction() {
  return {test::effect_fit("viscous", {}, {1.5}), test::effect_fit("coulomb", {}, {2})};
}

/// A least-squares fit of a pendulum's log.
class OfAPendulum : public testing::Test {
 protected:
  OfAPendulum() : plant_(test::model_of(test::pendulum(2), friction())), logs_(test::train_and_validate(plant_, 0.01)) {
    project_ = test::small_project("possible", plant_.robot, logs_);
    data_ = test::small_gate_data(logs_);
    project_.identify.physical = false;
    fitter_ = std::make_unique<Fitter>(plant_.robot, data_.logs, test::design_of(plant_));
    fitter_->reweight();
    model_ = finish_model(*fitter_, project_, data_).model;
  }
  /// Place of a base parameter whose name begins so.
  std::size_t place(const std::string& name) const {
    for (std::size_t i = 0; i < model_.base.size(); ++i) {
      if (model_.base[i].name.starts_with(name)) return i;
    }
    std::string names;
    for (const BaseParameter& parameter : model_.base) names += parameter.name + " ";
    ADD_FAILURE() << "no " << name << " in " << names;
    return 0;
  }

  IdentifiedModel plant_;
  std::vector<Log> logs_;
  Project project_;
  GateData data_;
  std::unique_ptr<Fitter> fitter_;
  IdentifiedModel model_;
};

TEST_F(OfAPendulum, APossibleModelStaysAndTheMassThatNoTorqueShowsIsTheUrdfs) {
  const PossibleModel same = possible_model(project_, model_, data_.logs);
  EXPECT_FALSE(same.bodies.constrained);
  EXPECT_EQ(to_json(same.model), to_json(model_));
  // Both joints' axes are level and fixed in height: link 1 shows its first moment, not its mass.
  EXPECT_LT(same.bodies.share[0].mass, determined_share);
  EXPECT_NEAR(same.bodies.inertia[0].m, 2, 0.02);
}

TEST_F(OfAPendulum, AnImpossibleModelMovesToThePossibleOneThatTheLogsTellApartLeast) {
  IdentifiedModel impossible = model_;
  const std::size_t inertia = place("Jxx2");
  impossible.base[inertia].value *= -0.2;  // a link that turns the wrong way
  impossible.joints[1].effects[0].linear[0] = -0.02;
  const PossibleModel possible = possible_model(project_, impossible, data_.logs);
  ASSERT_TRUE(possible.bodies.constrained);
  EXPECT_GT(possible.model.base[inertia].value * model_.base[inertia].value, 0);
  EXPECT_GE(possible.model.joints[1].effects[0].linear[0], 0);
  for (const double eigenvalue : possible.bodies.smallest_eigenvalue) EXPECT_GT(eigenvalue, 0);
  // The bodies have the model's torque: base parameters are the same sums.
  for (std::size_t i = 0; i < model_.base.size(); ++i)
    EXPECT_EQ(possible.model.base[i].value, possible.bodies.beta[static_cast<Eigen::Index>(i)]);
  // It is possible now, and its bodies are found again.
  const PossibleModel again = possible_model(project_, possible.model, data_.logs);
  EXPECT_FALSE(again.bodies.constrained);
  EXPECT_EQ(to_json(again.model), to_json(possible.model));
  EXPECT_LT((again.bodies.beta - possible.bodies.beta).norm(), 1e-12 * possible.bodies.beta.norm());
  EXPECT_EQ(possible.model.base[inertia].std, impossible.base[inertia].std);
  EXPECT_EQ(possible.model.stage, impossible.stage);
}

TEST_F(OfAPendulum, EachLinksCommentSaysWhatTheLogsDecided) {
  PhysicalFit fit = possible_model(project_, model_, data_.logs).bodies;
  fit.share[0].mass = 0.034;
  fit.share[0].centre = {0.98, 0, 1};
  const std::vector<std::string> comments = share_comments(fit);
  ASSERT_EQ(comments.size(), 2U);
  EXPECT_TRUE(comments[0].starts_with("data_share mass 0.03, centre 0.98 0.00 1.00, first moment ")) << comments[0];
  EXPECT_NE(comments[0].find("inertias of the URDF"), std::string::npos) << comments[0];
}

TEST_F(OfAPendulum, BesideItsOwnBaseParametersAFitFindsItsOwnCoefficients) {
  const Solution whole = fitter_->estimate();
  const Solution beside = fitter_->estimate_beside(whole.beta, true);
  for (std::size_t j = 0; j < 2; ++j) EXPECT_LT((beside.theta[j] - whole.theta[j]).norm(), 1e-9);
  const std::vector<Judgement> known = fitter_->held_out_beside(whole.beta);
  EXPECT_NEAR(known[0].rmse, fitter_->held_out()[0].rmse, 1e-6);
}

TEST_F(OfAPendulum, WhatOneJointGetsBesideBaseParametersChangesNoOther) {
  const Solution whole = fitter_->estimate();
  const Solution before = fitter_->estimate_beside(whole.beta, false);
  JointFit design = fitter_->design(0);
  design.effects.push_back(test::effect_fit("stribeck", {0.3}, {}));
  Fitter more = *fitter_;
  more.set_design(0, design);
  const Solution after = more.estimate_beside(whole.beta, false);
  EXPECT_EQ(after.theta[1], before.theta[1]);
  EXPECT_EQ(after.theta[0].size(), before.theta[0].size() + 1);
}

TEST_F(OfAPendulum, BesideBaseParametersACoefficientKeepsItsBound) {
  IdentifiedModel driven = plant_;
  driven.joints[1].effects[0].linear[0] = -0.5;
  const std::vector<ProcessedLog> logs = test::processed(test::train_and_validate(driven, 0.01));
  const Fitter fitter(plant_.robot, logs, test::design_of(plant_));
  const Eigen::VectorXd beta = fitter.estimate().beta;
  EXPECT_NEAR(fitter.estimate_beside(beta, false).theta[1][0], -0.5, 0.01);
  const Eigen::VectorXd bounded = fitter.estimate_beside(beta, true).theta[1];
  EXPECT_EQ(bounded[0], 0);
  EXPECT_LT(bounded[1], 2);  // Coulomb friction makes up for it
  EXPECT_GT(bounded[1], 0);
}

}  // namespace
}  // namespace fxdyn
