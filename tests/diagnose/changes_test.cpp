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

TEST(Changes, TheOneOnTopIsFound) {
  const EffectFit presliding = test::effect("presliding", {0.01}, {4});
  const std::vector<SessionLog> logs = two_sessions(presliding, 4, 8);
  Models models = test::around(test::fitted_puma());
  models.has_baseline = true;
  models.current->joints[1].effects.push_back(presliding);
  models.healthy = models.current;
  models.held = {{"presliding", 1, {0.01}}};
  Progress progress;
  const Outcome outcome = explore(models, logs, {}, 1, progress);
  ASSERT_EQ(outcome.found.size(), 1U);
  const EffectFit& found = outcome.models.current->joints[1].effects.at(outcome.found[0].id.effect);
  EXPECT_EQ(found.effect, "presliding");
  EXPECT_NEAR(found.linear[0], 4, 0.4);
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
