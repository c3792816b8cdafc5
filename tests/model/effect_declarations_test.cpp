// What effects declare beside their formula, and the usual values of shape parameters.

#include <gtest/gtest.h>

#include <cmath>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "model/shapes.hpp"

namespace fxdyn {
namespace {

std::vector<double> list(const ValueList& values) { return {values.begin(), values.end()}; }

TEST(EffectDeclarations, ListsAreThoseOfTheTraits) {
  EXPECT_EQ(nominal_effects(), (std::vector<std::string>{"viscous", "coulomb", "offset", "rotor_inertia"}));
  EXPECT_EQ(identified_effects(),
            (std::vector<std::string_view>{"motor_coupling", "asymmetric_friction", "presliding", "stribeck"}));
  const auto named = [](auto&& has) {
    std::vector<std::string_view> names;
    for (const EffectInfo& info : effect_infos()) {
      if (has(info)) names.push_back(info.name);
    }
    return names;
  };
  using Names = std::vector<std::string_view>;
  EXPECT_EQ(named([](const EffectInfo& info) { return info.has_constant; }), (Names{"offset", "spring"}));
  EXPECT_EQ(named([](const EffectInfo& info) { return info.bends(); }), (Names{"elasticity", "backlash"}));
  EXPECT_EQ(named([](const EffectInfo& info) { return info.of_spectrum(); }), (Names{"ripple"}));
  EXPECT_EQ(named([](const EffectInfo& info) { return info.drifts(); }), (Names{"friction_drift"}));
  EXPECT_EQ(named([](const EffectInfo& info) { return info.several; }), (Names{"ripple", "joint_coupling"}));
  EXPECT_EQ(named([](const EffectInfo& info) { return info.share; }), (Names{"saturation", "delay"}));
  EXPECT_EQ(named([](const EffectInfo& info) { return info.unites_others(); }), (Names{"lugre"}));
}

TEST(EffectDeclarations, WhatIsNamedElsewhereIsInTheCatalogue) {
  for (const EffectInfo& info : effect_infos()) {
    for (const std::string_view other :
         {info.replaces, info.warms_into[0], info.warms_into[1], info.unites[0], info.unites[1]})
      EXPECT_TRUE(other.empty() || find_effect(other) != nullptr) << info.name << ": " << other;
    if (info.acts_on == ActsOn::position) {
      for (const ParameterInfo& shape : info.shape) EXPECT_TRUE(shape.values.of_link.given()) << info.name;
    }
  }
}

TEST(EffectDeclarations, TheRefinedShapeIsTheContinuousOne) {
  EXPECT_EQ(find_effect("viscous")->refined_shape(), -1);
  EXPECT_EQ(find_effect("stribeck")->refined_shape(), 0);
  EXPECT_EQ(find_effect("joint_coupling")->refined_shape(), -1);
  EXPECT_EQ(find_effect("motor_coupling")->refined_shape(), 2);
  EXPECT_EQ(find_effect("lugre")->refined_shapes(), (std::vector<std::size_t>{0, 1, 2}));
}

TEST(EffectDeclarations, TheFirstCommonExperimentTellsTwoEffectsApart) {
  const auto telling = [](std::string_view a, std::string_view b) {
    return telling_experiment(*find_effect(a), *find_effect(b));
  };
  EXPECT_EQ(telling("viscous", "saturation"), experiments::loaded_poses.text) << "not constant speeds, which both name";
  EXPECT_EQ(telling("viscous_cubic", "saturation"), experiments::constant_speeds.text);
  EXPECT_EQ(telling("ripple", "offset"), experiments::wide_range.text);
  EXPECT_EQ(telling("delay", "viscous"), "");
}

TEST(Cure, IsAnExperimentThatBothEffectsName) {
  EXPECT_EQ(cure("viscous", "saturation"),
            "poses in which the joint carries load, moved slowly with and against gravity");
  EXPECT_EQ(cure("viscous_cubic", "saturation"), "constant speeds from slow to the limit");
  EXPECT_EQ(cure("ripple", "offset"), "a wider range of positions");
  EXPECT_EQ(cure("ripple", "base parameters"), "a wider range of positions, or a baseline");
  EXPECT_EQ(cure("rotor_inertia", "base parameters"),
            "nothing: base parameters hold the rotor, and the torque is the same");
  EXPECT_EQ(cure("payload", "base parameters"),
            "the same motions recorded without it (role = \"baseline\"), or inertias known beforehand");
  EXPECT_EQ(cure("joint_coupling", "coulomb"), "joints moved one at a time");
  EXPECT_EQ(cure("delay", "viscous"), "other positions, speeds and loads in other combinations");
}

TEST(EffectDeclarations, ARotorIsTheEffectThatBaseParametersMayHold) {
  JointFit joint;
  joint.effects.resize(1);
  joint.effects[0].effect = "viscous";
  EXPECT_EQ(rotor_of(joint), nullptr);
  joint.effects.resize(2);
  joint.effects[1].effect = "rotor_inertia";
  EXPECT_EQ(rotor_of(joint), &joint.effects[1]);
}

TEST(EffectDeclarations, ADelayIsBoundedByItsMemory) {
  const EffectInfo& delay = *find_effect("delay");
  EXPECT_DOUBLE_EQ(upper_bound(delay, delay.shape[0], 0.001), 0.015);
  EXPECT_DOUBLE_EQ(upper_bound(delay, delay.shape[0], 0.1), 0.03) << "its own bound";
  const EffectInfo& stribeck = *find_effect("stribeck");
  EXPECT_DOUBLE_EQ(upper_bound(stribeck, stribeck.shape[0], 0.001), 1e3);
}

TEST(Shapes, VelocitiesBeginAboveTheSign) {
  MotionScales s;
  s.speed = 2;
  s.sign_width = 0.01;
  const auto values = list(shapes::velocity.tried(s));
  ASSERT_EQ(values.size(), 9U);
  EXPECT_DOUBLE_EQ(values.front(), 0.015);
  EXPECT_DOUBLE_EQ(values.back(), 0.4);
  EXPECT_NEAR(values[4], std::sqrt(0.015 * 0.4), 1e-12) << "equal ratios";
  s.sign_width = 1;
  EXPECT_DOUBLE_EQ(shapes::velocity.tried(s)[0], 0.2) << "however wide the sign is";
}

TEST(Shapes, OtherJointsAndMates) {
  MotionScales s;
  s.joint = 1;
  s.joints = 4;
  s.like_previous = true;
  EXPECT_EQ(list(shapes::other_joint.tried(s)), (std::vector<double>{1, 3, 4}));
  EXPECT_EQ(list(shapes::other_joint.judged(s)), (std::vector<double>{1, 3, 4}));
  EXPECT_EQ(list(shapes::neighbour.tried(s)), (std::vector<double>{1})) << "of the same type only";
  EXPECT_EQ(list(shapes::neighbour.judged(s)), (std::vector<double>{1, 3}));
  s.joint = 2;
  EXPECT_EQ(list(shapes::other_joint.judged(s)), (std::vector<double>{2, 1, 4})) << "the one before first";
}

TEST(Shapes, PathsAndWavenumbersDependOnTheJointsType) {
  MotionScales s;
  EXPECT_DOUBLE_EQ(shapes::distance.tried(s)[0], 2e-4);
  EXPECT_EQ(list(shapes::wavenumber.judged(s)), (std::vector<double>{20, 4, 100}));
  s.turns = false;
  EXPECT_DOUBLE_EQ(shapes::distance.tried(s)[0], 1e-5);
  EXPECT_EQ(list(shapes::wavenumber.judged(s)), (std::vector<double>{600, 120, 3000}));
}

TEST(Shapes, CombinationsChangeTheFirstParameterFastest) {
  EXPECT_EQ(combinations({}), (std::vector<std::vector<double>>{{}}));
  EXPECT_EQ(combinations({{1, 2}, {}}), (std::vector<std::vector<double>>{})) << "nothing to combine with";
  EXPECT_EQ(combinations({{1, 2}, {3, 4}}), (std::vector<std::vector<double>>{{1, 3}, {2, 3}, {1, 4}, {2, 4}}));
}

}  // namespace
}  // namespace fxdyn
