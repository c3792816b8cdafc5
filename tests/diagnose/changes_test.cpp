#include "host_tools/diagnose/changes.hpp"

#include <gtest/gtest.h>

#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

/// Names of the effects that changed since the baseline, where one of joint 2 has grown from `before` to `now`.
std::vector<std::string> changed(EffectFit effect, double before, double now) {
  Models models = test::around(test::fitted_puma());
  models.has_baseline = true;
  effect.linear[0] = before;
  models.current.joints[1].effects.push_back(effect);
  models.healthy = models.current;
  models.current.joints[1].effects.back().linear[0] = now;
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

}  // namespace
}  // namespace fxdyn::diagnosis
