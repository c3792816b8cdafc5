// The best shape of one effect, on noise-free data whose plant has one.

#include "host_tools/identify/shape_search.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "host_tools/support/error.hpp"
#include "tests/support/pendulum.hpp"

namespace fxdyn {
namespace {

const Scales scales{2, 3};  // 2 rad/s, 3 rad: exact_log()'s
constexpr double width = 0.05;

std::vector<EffectFit> friction() {
  return {test::effect_fit("viscous", {}, {1.5}), test::effect_fit("coulomb", {}, {2})};
}

/// Two logs of a plant, and a fitter of another design on them.
struct Fitted {
  std::vector<ProcessedLog> logs;
  Fitter fitter;

  Fitted(const IdentifiedModel& plant, const std::vector<JointFit>& design)
      : logs(test::processed({test::exact_log(plant, Role::train, 1), test::exact_log(plant, Role::validate, 2)})),
        fitter(plant.robot, logs, design) {}
};

TEST(ShapeSearch, FindsTheWidthOfTheSign) {
  const IdentifiedModel plant = test::model_of(test::pendulum(), friction());
  std::vector<JointFit> design = test::design_of(plant);
  design[0].sign_width = 0.3;
  const Fitted fitted(plant, design);
  const Candidate found = search_width(fitted.fitter, 0, scales);
  // The grid's step of 3000^(1/11), then a half and a quarter of it, is what remains.
  EXPECT_NEAR(std::log(found.design.sign_width / width), 0, 0.25 * std::log(3000) / 11);
  EXPECT_LT(found.judgement.rmse, 0.1 * fitted.fitter.held_out()[0].rmse);
  EXPECT_EQ(fitted.fitter.design(0).sign_width, 0.3);  // it only proposes
}

TEST(ShapeSearch, FindsTheVelocityOfStribecksEffect) {
  std::vector<EffectFit> effects = friction();
  effects.push_back(test::effect_fit("stribeck", {0.12}, {3}));
  const IdentifiedModel plant = test::model_of(test::pendulum(), effects);
  const Fitted fitted(plant, test::design_of(test::model_of(test::pendulum(), friction())));
  const Candidate found = search_effect(fitted.fitter, 0, "stribeck", scales, {});
  ASSERT_EQ(found.design.effects.size(), 3U);
  // Between 0.006 and 0.3 rad/s.
  EXPECT_NEAR(std::log(found.design.effects[2].shape[0] / 0.12), 0, 0.25 * std::log(50) / 11);
  EXPECT_LT(found.judgement.rmse, 0.1 * fitted.fitter.held_out()[0].rmse);
}

TEST(ShapeSearch, AnEffectWithoutAShapeIsJudgedAsItIs) {
  std::vector<EffectFit> effects = friction();
  effects.push_back(test::effect_fit("viscous_cubic", {}, {0.4}));
  const IdentifiedModel plant = test::model_of(test::pendulum(), effects);
  const Fitted fitted(plant, test::design_of(test::model_of(test::pendulum(), friction())));
  const Candidate found = search_effect(fitted.fitter, 0, "viscous_cubic", scales, {});
  EXPECT_TRUE(found.design.effects.back().shape.empty());
  EXPECT_GT(fitted.fitter.held_out()[0].rmse, 0.01);
  EXPECT_LT(found.judgement.rmse, 1e-6);
}

TEST(ShapeSearch, ACouplingFindsNeighbourAndDirection) {
  IdentifiedModel plant = test::model_of(test::pendulum(3), friction());
  plant.joints[1].effects.push_back(test::effect_fit("motor_coupling", {3, -1, width}, {2, 0.5, 0.1}));
  const Fitted fitted(plant, test::design_of(test::model_of(test::pendulum(3), friction())));
  const Candidate found = search_effect(fitted.fitter, 1, "motor_coupling", scales, {});
  ASSERT_EQ(found.design.effects.size(), 3U);
  const std::vector<double>& shape = found.design.effects[2].shape;
  EXPECT_EQ(shape[0], 3);
  EXPECT_EQ(shape[1], -1);
  EXPECT_LT(found.judgement.rmse, 0.05 * fitted.fitter.held_out()[1].rmse);
}

TEST(ShapeSearch, ACouplingNeedsASecondJoint) {
  const IdentifiedModel plant = test::model_of(test::pendulum(), friction());
  const Fitted fitted(plant, test::design_of(plant));
  EXPECT_THROW(search_effect(fitted.fitter, 0, "motor_coupling", scales, {}), InputError);
}

TEST(ShapeSearch, LugreTakesThePlaceOfWhatItUnites) {
  IdentifiedModel plant = test::model_of(test::pendulum(), friction());
  plant.joints[0].effects.push_back(test::effect_fit("lugre", {0.01, 0.1, 0.667}, {6, 10}));
  for (EffectFit& fit : plant.joints[0].effects) {
    if (fit.effect == "coulomb") fit.linear = {0.667 * 6};  // LuGre's own, see regression/tie.hpp
  }
  std::vector<EffectFit> parts = friction();
  parts.push_back(test::effect_fit("stribeck", {0.09}, {}));
  parts.push_back(test::effect_fit("presliding", {0.012}, {}));
  Fitted fitted(plant, test::design_of(test::model_of(test::pendulum(), parts)));
  const double before = fitted.fitter.held_out()[0].rmse;
  const Candidate found = search_effect(fitted.fitter, 0, "lugre", scales, {});
  EXPECT_EQ(found.design.find("stribeck"), nullptr);
  EXPECT_EQ(found.design.find("presliding"), nullptr);
  // The search ends within a step of its grid; what follows it ends at the truth.
  fitted.fitter.set_design(0, found.design);
  fitted.fitter.polish();
  const EffectFit* lugre = fitted.fitter.design(0).find("lugre");
  ASSERT_NE(lugre, nullptr);
  EXPECT_NEAR(std::log(lugre->shape[0] / 0.01), 0, 0.02);
  EXPECT_NEAR(std::log(lugre->shape[1] / 0.1), 0, 0.02);
  EXPECT_NEAR(std::log(lugre->shape[2] / 0.667), 0, 0.02);
  EXPECT_LT(found.judgement.rmse, 0.2 * before);
}

}  // namespace
}  // namespace fxdyn
