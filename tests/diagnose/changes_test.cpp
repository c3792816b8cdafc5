#include "host_tools/diagnose/changes.hpp"

#include <gtest/gtest.h>

#include "host_tools/diagnose/certainty.hpp"
#include "host_tools/support/progress.hpp"
#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

/// Names of the effects that changed since the baseline, where one of joint 2 has grown from `before` to `now`.
std::vector<std::string> changed(EffectFit effect, double before, double now) {
  Models models = test::around(test::fitted_puma());
  models.has_baseline = true;
  effect.linear[0] = before;
  models.current->joints[1].effects.push_back(effect);
  models.healthy = models.current;
  models.current->joints[1].effects.back().linear[0] = now;
  const std::vector<SessionLog> logs{test::small_session_log(models.current, Role::train, 1),
                                     test::small_session_log(models.healthy, Role::baseline, 2)};
  std::vector<std::string> out;
  for (const EffectCandidate& one : changed_effects(Linearised(models, logs, test::no_whitening())))
    out.push_back(one.effect);
  return out;
}

using Names = std::vector<std::string>;

TEST(Changes, DryFrictionWithMemoryThatGrewIsHeldAndWhatCameOnTopIsLookedFor) {
  EXPECT_EQ(changed(test::effect("presliding", {0.01}, {4}), 4, 6), Names{"presliding"});
  EXPECT_EQ(changed(test::effect("stribeck", {0.2}, {4}), 4, 6), Names{"stribeck"});
}

TEST(Changes, ALittleIsWhatSessionsDifferBy) {
  EXPECT_EQ(changed(test::effect("presliding", {0.01}, {4}), 4, 4.4), Names{});
}

TEST(Changes, FrictionInProportionToTheVelocityGrowsAsTheGreaseIsColder) {
  EXPECT_EQ(changed(test::effect("viscous_quadratic", {}, {4}), 4, 6), Names{});
}

TEST(Changes, ARippleThatGrewIsHeld) {
  EXPECT_EQ(changed(test::effect("ripple", {14}, {4, 0}), 4, 8), Names{"ripple"});
}

TEST(Changes, AGainThatGrewIsHeld) {
  EXPECT_EQ(changed(test::effect("torque_gain", {}, {0.05}), 0.05, 0.09), Names{"torque_gain"});
  EXPECT_EQ(changed(test::effect("torque_gain", {}, {0.05}), 0.05, 0.055), Names{});
}

/// Two sessions of a PUMA whose second joint has an effect, of this size before and now.
std::vector<SessionLog> two_sessions(EffectFit effect, double before, double now) {
  std::vector<SessionLog> out;
  for (const auto& [role, size, seed] :
       {std::tuple{Role::train, now, 1}, std::tuple{Role::validate, now, 2}, std::tuple{Role::baseline, before, 3}}) {
    IdentifiedModel robot = test::fitted_puma();
    effect.linear[0] = size;
    robot.joints[1].effects.push_back(effect);
    out.push_back(test::small_session_log(robot, role, static_cast<std::uint64_t>(seed)));
  }
  return out;
}

/// What is found of an effect of joint 2 whose coefficient was `before` and is `now`, as that is held.
std::vector<EffectFit> found_on_top(const EffectFit& effect, double before, double now) {
  const std::vector<SessionLog> logs = two_sessions(effect, before, now);
  Models models = test::around(test::fitted_puma());
  models.has_baseline = true;
  models.current->joints[1].effects.push_back(effect);
  models.healthy = models.current;
  models.held = {{effect.effect, 1, effect.shape}};
  Progress progress;
  const Outcome outcome = explore(models, logs, {}, 1, progress);
  std::vector<EffectFit> out;
  for (const Finding& finding : outcome.found)
    out.push_back(outcome.models.current->joints[1].effects.at(finding.id.effect));
  return out;
}

TEST(Changes, TheOneOnTopIsFound) {
  const std::vector<EffectFit> found = found_on_top(test::effect("presliding", {0.01}, {4}), 4, 8);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].effect, "presliding");
  EXPECT_NEAR(found[0].linear[0], 4, 0.4);
}

TEST(Changes, AGainOnTopScalesTheOther) {
  const std::vector<EffectFit> found = found_on_top(test::effect("torque_gain", {}, {0.05}), 0.05, 0.15);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].effect, "torque_gain");
  EXPECT_NEAR(found[0].linear[0], 0.1 / 1.05, 0.01);
}

/// What speaks for quadratic friction of joint 2 as a change, where the healthy session has as much of it or none.
double speaks_for_a_change(double before) {
  const EffectFit quadratic = test::named_effect("viscous_quadratic", {}, {1});
  const std::vector<SessionLog> logs = two_sessions(quadratic, before, 1);
  Models models = test::around(test::fitted_puma());
  models.has_baseline = true;
  models.healthy = models.current;
  models.current->joints[1].effects.push_back(quadratic);
  Linearised problem(models, logs, test::no_whitening());
  return new_since_baseline(problem, in_model(problem), 0);
}

TEST(Changes, WhatTheHealthySessionHasTooIsNone) {
  EXPECT_GT(speaks_for_a_change(0), 30);
  EXPECT_LT(speaks_for_a_change(1), -30);
}

}  // namespace
}  // namespace fxdyn::diagnosis
