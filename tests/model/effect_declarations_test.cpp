// What effects declare beside their formula, and the usual values of shape parameters.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <string_view>

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
  EXPECT_EQ(named([](const EffectInfo& info) { return info.remembers; }),
            (Names{"presliding", "friction_drift", "delay", "elasticity", "lugre", "maxwell_slip"}));
  EXPECT_EQ(named([](const EffectInfo& info) { return info.bends(); }), (Names{"elasticity", "backlash"}));
  EXPECT_EQ(named([](const EffectInfo& info) { return info.of_spectrum(); }), (Names{"ripple"}));
  EXPECT_EQ(named([](const EffectInfo& info) { return info.drifts(); }), (Names{"friction_drift"}));
  EXPECT_EQ(named([](const EffectInfo& info) { return info.several; }), (Names{"ripple", "joint_coupling"}));
  EXPECT_EQ(named([](const EffectInfo& info) { return info.share; }), (Names{"saturation", "delay"}));
  EXPECT_EQ(named([](const EffectInfo& info) { return info.unites_others(); }), (Names{"lugre", "maxwell_slip"}));
  EXPECT_EQ(named([](const EffectInfo& info) { return info.curve; }),
            (Names{"position_curve", "velocity_curve", "load_curve", "friction_over_position", "cross_position"}));
  EXPECT_EQ(named([](const EffectInfo& info) { return info.friction; }),
            (Names{"viscous", "coulomb", "offset", "stribeck", "presliding", "asymmetric_friction", "viscous_quadratic",
                   "viscous_cubic", "load_friction", "friction_drift", "lugre", "maxwell_slip", "velocity_curve",
                   "friction_over_position", "soft_knee"}))
      << "differs from day to day";
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

/// What model.json, scenarios and `fxdyn effects --json` promise of parameters.
struct Promise {
  std::string_view effect, parameter, unit;
  double lower, upper;
};
constexpr std::array promises = std::to_array<Promise>({
    {"viscous", "coefficient", "N*m*s/rad", 0, unbounded},
    {"coulomb", "amplitude", "N*m", 0, unbounded},
    {"offset", "torque", "N*m", -unbounded, unbounded},
    {"rotor_inertia", "inertia", "kg*m^2", 0, unbounded},
    {"stribeck", "velocity", "rad/s", 1e-05, 1000},
    {"stribeck", "amplitude", "N*m", 0, unbounded},
    {"soft_knee", "velocity", "rad/s", 1e-05, 1000},
    {"soft_knee", "amplitude", "N*m", 0, unbounded},
    {"presliding", "distance", "rad", 1e-07, 0.03},
    {"presliding", "amplitude", "N*m", 0, unbounded},
    {"asymmetric_friction", "coulomb", "N*m", -unbounded, unbounded},
    {"asymmetric_friction", "viscous", "N*m*s/rad", -unbounded, unbounded},
    {"viscous_quadratic", "coefficient", "N*m*s^2/rad^2", -unbounded, unbounded},
    {"viscous_cubic", "coefficient", "N*m*s^3/rad^3", -unbounded, unbounded},
    {"load_friction", "coefficient", "-", 0, 1},
    {"torque_gain", "gain", "-", -0.9, 10},
    {"ripple", "wavenumber", "rad^-1", 0.5, 100000},
    {"ripple", "cos", "N*m", -unbounded, unbounded},
    {"ripple", "sin", "N*m", -unbounded, unbounded},
    {"spring", "stiffness", "N*m/rad", -unbounded, unbounded},
    {"spring", "offset", "N*m", -unbounded, unbounded},
    {"gravity_compensator", "cos", "N*m", -unbounded, unbounded},
    {"gravity_compensator", "sin", "N*m", -unbounded, unbounded},
    {"friction_drift", "time_constant", "s", 0.1, 10000},
    {"friction_drift", "coulomb", "N*m", -unbounded, unbounded},
    {"friction_drift", "viscous", "N*m*s/rad", -unbounded, unbounded},
    {"saturation", "limit", "N*m", 0, unbounded},
    {"saturation", "share", "-", 0, 2},
    {"joint_coupling", "joint", "-", 1, 32},
    {"joint_coupling", "coulomb", "N*m", -unbounded, unbounded},
    {"joint_coupling", "viscous", "N*m*s/rad", -unbounded, unbounded},
    {"delay", "time", "s", 0, 0.03},
    {"delay", "share", "-", 0, 2},
    {"elasticity", "relaxation", "s", 0, 1},
    {"elasticity", "compliance", "rad/(N*m)", 0, unbounded},
    {"backlash", "torque_scale", "N*m", 0.001, 100000},
    {"backlash", "half_gap", "rad", 0, 0.1},
    {"eccentricity", "sin", "rad", -0.1, 0.1},
    {"eccentricity", "cos", "rad", -0.1, 0.1},
    {"motor_coupling", "joint", "-", 1, 32},
    {"motor_coupling", "ratio", "-", -100, 100},
    {"motor_coupling", "width", "rad/s", 1e-05, 1000},
    {"motor_coupling", "coulomb", "N*m", 0, unbounded},
    {"motor_coupling", "viscous", "N*m*s/rad", 0, unbounded},
    {"motor_coupling", "inertia", "kg*m^2", 0, unbounded},
    {"lugre", "distance", "rad", 1e-07, 0.03},
    {"lugre", "velocity", "rad/s", 1e-05, 1000},
    {"lugre", "share", "1", 0.25, 0.99},
    {"lugre", "static", "N*m", 0, unbounded},
    {"lugre", "damping", "N*m*s/rad", 0, unbounded},
    {"maxwell_slip", "distance", "rad", 1e-07, 0.1},
    {"maxwell_slip", "force_1", "N*m", 0, unbounded},
    {"maxwell_slip", "force_2", "N*m", 0, unbounded},
    {"maxwell_slip", "force_3", "N*m", 0, unbounded},
    {"maxwell_slip", "force_4", "N*m", 0, unbounded},
    {"maxwell_slip", "force_5", "N*m", 0, unbounded},
    {"position_curve", "from", "rad", -1e3, 1e3},
    {"position_curve", "span", "rad", 1e-4, 1e3},
    {"position_curve", "height_1", "N*m", -unbounded, unbounded},
    {"position_curve", "height_12", "N*m", -unbounded, unbounded},
    {"velocity_curve", "from", "rad/s", -1e3, 1e3},
    {"velocity_curve", "span", "rad/s", 1e-4, 1e3},
    {"velocity_curve", "height_12", "N*m", -unbounded, unbounded},
    {"load_curve", "from", "N*m", -1e6, 1e6},
    {"load_curve", "span", "N*m", 1e-4, 1e6},
    {"load_curve", "height_12", "N*m", -unbounded, unbounded},
    {"friction_over_position", "from", "rad", -1e3, 1e3},
    {"friction_over_position", "span", "rad", 1e-4, 1e3},
    {"friction_over_position", "height_12", "N*m", -unbounded, unbounded},
    {"cross_position", "joint", "-", 1, 32},
    {"cross_position", "from", "rad or m", -1e3, 1e3},
    {"cross_position", "span", "rad or m", 1e-4, 1e3},
    {"cross_position", "height_12", "N*m", -unbounded, unbounded},
    {"payload", "mass", "kg", 0, unbounded},
    {"payload", "com_x", "m", -10, 10},
    {"payload", "com_y", "m", -10, 10},
    {"payload", "com_z", "m", -10, 10},
    {"gravity_tilt", "tilt_x", "rad", -0.5, 0.5},
    {"gravity_tilt", "tilt_y", "rad", -0.5, 0.5},
});

TEST(EffectDeclarations, UnitsAndBoundsOfParametersAreAsPromised) {
  for (const Promise& promise : promises) {
    const EffectInfo* effect = find_effect(promise.effect);
    ASSERT_NE(effect, nullptr) << promise.effect;
    const ParameterInfo* found = nullptr;
    for (const auto& parameters : {effect->shape, effect->linear})
      for (const ParameterInfo& parameter : parameters)
        if (parameter.name == promise.parameter) found = &parameter;
    ASSERT_NE(found, nullptr) << promise.effect << " " << promise.parameter;
    EXPECT_EQ(found->unit, promise.unit) << promise.effect << " " << promise.parameter;
    EXPECT_EQ(found->lower, promise.lower) << promise.effect << " " << promise.parameter;
    EXPECT_EQ(found->upper, promise.upper) << promise.effect << " " << promise.parameter;
  }
}

TEST(EffectDeclarations, NoTwoExperimentsHaveTheSameNumber) {
  std::map<int, std::string_view> texts;
  for (const EffectInfo& info : effect_infos())
    for (const auto& experiment : info.experiments) {
      if (experiment.text.empty()) continue;
      const auto [at, is_new] = texts.emplace(static_cast<int>(experiment.order), experiment.text);
      EXPECT_TRUE(is_new || at->second == experiment.text) << at->second << "; " << experiment.text;
    }
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
  // Where a fit may lead is where the search begins.
  s.sign_width = 0.01;
  EXPECT_DOUBLE_EQ(shapes::velocity_beyond_sign.tried(s)[0], shapes::velocity_beyond_sign.least_of_sign * s.sign_width);
  EXPECT_EQ(shapes::velocity.least_of_sign, 0);
}

TEST(Shapes, AGapIsClosedByTheLargestLoad) {
  EXPECT_NEAR(std::tanh(1 / shapes::small_load.most_of_load), 0.987, 5e-4);
  EXPECT_EQ(shapes::torque_limit.most_of_load, 0);
}

TEST(Shapes, ARobotOfOneJointHasNoOthers) {
  const MotionScales alone;
  EXPECT_EQ(list(shapes::other_joint.tried(alone)), std::vector<double>{});
  EXPECT_EQ(list(shapes::other_joint.judged(alone)), std::vector<double>{});
  EXPECT_EQ(list(shapes::neighbour.judged(alone)), std::vector<double>{});
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
  s.like_previous = false;
  s.like_next = true;
  EXPECT_EQ(list(shapes::neighbour.tried(s)), (std::vector<double>{3}));
  s.joint = 2;
  EXPECT_EQ(list(shapes::other_joint.judged(s)), (std::vector<double>{2, 1, 4})) << "the one before first";
  s.joint = 3;
  EXPECT_EQ(list(shapes::neighbour.judged(s)), (std::vector<double>{3})) << "the last one";
  s.joint = 0;
  EXPECT_EQ(list(shapes::neighbour.judged(s)), (std::vector<double>{2})) << "the first one";
}

TEST(Shapes, PathsAndWavenumbersDependOnTheJointsType) {
  MotionScales s;
  EXPECT_DOUBLE_EQ(shapes::distance.tried(s)[0], 2e-4);
  EXPECT_EQ(list(shapes::wavenumber.judged(s)), (std::vector<double>{20, 4, 100}));
  s.turns = false;
  EXPECT_DOUBLE_EQ(shapes::distance.tried(s)[0], 1e-5);
  EXPECT_EQ(list(shapes::wavenumber.judged(s)), (std::vector<double>{600, 120, 3000}));
}

TEST(Shapes, UsualValues) {
  MotionScales s;
  EXPECT_EQ(list(shapes::distance.judged(s)), (std::vector<double>{3e-3, 1e-3, 9e-3}));
  EXPECT_DOUBLE_EQ(list(shapes::distance.tried(s)).back(), 2e-2);
  EXPECT_EQ(list(shapes::distance.tried(s)).size(), 10U);
  s.turns = false;
  EXPECT_EQ(list(shapes::distance.judged(s)), (std::vector<double>{1e-4, 3e-5, 3e-4}));
  EXPECT_DOUBLE_EQ(list(shapes::distance.tried(s)).back(), 1e-3);
  EXPECT_EQ(list(shapes::delay.judged(s)), (std::vector<double>{2e-3, 1e-3, 4e-3}));
  EXPECT_EQ(list(shapes::relaxation.tried(s)), (std::vector<double>{1e-3, 8e-3}));
  EXPECT_EQ(list(shapes::relaxation.judged(s)), (std::vector<double>{1e-3, 5e-3}));
  EXPECT_EQ(list(shapes::relaxation.of_link(s)), (std::vector<double>{1e-3, 0, 1e-3, 3e-3, 8e-3, 2e-2}));
  EXPECT_EQ(list(shapes::friction_share.tried(s)), (std::vector<double>{0.7, 0.5, 0.85}));
  EXPECT_EQ(list(shapes::direction.tried(s)), (std::vector<double>{1, -1}));
}

TEST(Shapes, UsualValuesGoWithTheMotion) {
  MotionScales s;
  s.speed = 10, s.range = 100, s.torque = 100, s.structural = 1000, s.seconds = 20, s.sign_width = 0.1, s.upper = 0.03;
  const auto near = [](const ValueList& values, std::vector<double> expected) {
    ASSERT_EQ(values.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i)
      EXPECT_NEAR(list(values)[i], expected[i], 1e-9 * expected[i]) << i;
  };
  const auto ends = [](const ValueList& values, std::size_t count, double first, double last) {
    ASSERT_EQ(values.size(), count);
    EXPECT_NEAR(list(values).front(), first, 1e-9 * first);
    EXPECT_NEAR(list(values).back(), last, 1e-9 * last);
  };
  near(shapes::velocity.judged(s), {0.25, 0.1, 0.5});
  near(shapes::time_constant.judged(s), {20, 6, 60});
  near(shapes::torque_limit.judged(s), {85, 70, 95});
  near(shapes::torque_limit.tried(s), {45, 55, 63, 70, 76, 82, 87, 91, 95});
  near(shapes::small_load.judged(s), {50, 20, 100});
  near(shapes::small_load.of_link(s), {30, 10, 25, 60, 150});
  ends(shapes::time_constant.tried(s), 5, 2, 80);
  ends(shapes::delay.tried(s), 5, 5e-4, 0.03);
  ends(shapes::small_load.tried(s), 4, 15, 250);
  const auto range = [](ShapeRange found, double from, double to) {
    EXPECT_DOUBLE_EQ(found.from, from);
    EXPECT_DOUBLE_EQ(found.to, to);
  };
  range(shapes::velocity.fitted(s), 0.03, 1.5);
  range(shapes::distance.fitted(s), 1e-4, 10);
  range(shapes::friction_share.fitted(s), 0.3, 1);
}

TEST(Shapes, CombinationsChangeTheFirstParameterFastest) {
  EXPECT_EQ(combinations({}), (std::vector<std::vector<double>>{{}}));
  EXPECT_EQ(combinations({{1, 2}, {}}), (std::vector<std::vector<double>>{})) << "nothing to combine with";
  EXPECT_EQ(combinations({{1, 2}, {3, 4}}), (std::vector<std::vector<double>>{{1, 3}, {2, 3}, {1, 4}, {2, 4}}));
}

}  // namespace
}  // namespace fxdyn
