// What is learned of a healthy session whose friction has memory.

#include "host_tools/diagnose/healthy_session.hpp"

#include <gtest/gtest.h>

#include "host_tools/support/progress.hpp"
#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

constexpr double late_s = -0.004;

/// One log of a PUMA whose first joint has presliding friction, learned by a model with this torque lead.
HealthySession learned(double lead_s, double amplitude) {
  IdentifiedModel robot = test::fitted_puma();
  robot.joints[0].effects.push_back(test::effect("presliding", {0.01}, {amplitude}));
  const std::vector<SessionLog> logs{test::small_session_log(robot, Role::train, 1)};
  IdentifiedModel nominal = test::fitted_puma();
  nominal.filter.torque_lead_s = lead_s;
  SearchTask task;
  task.settings.max_effects = 2;
  Progress progress;
  return learn_healthy(test::around(nominal), logs, task, progress);
}

TEST(HealthySession, FrictionWithMemoryIsLearnedWithoutAName) {
  const HealthySession session = learned(0, 8);
  ASSERT_FALSE(session.effects.empty());
  EXPECT_EQ(session.effects[0].joint, 0U);
  EXPECT_TRUE(session.structured.empty());
  for (const JointFit& joint : session.models.current->joints) {
    for (const EffectFit& effect : joint.effects) EXPECT_FALSE(effect.named) << effect.effect;
  }
}

TEST(HealthySession, AnAlignedTorqueErrsLessOnceFrictionIsKnown) {
  const HealthySession aligned = learned(0, 8), late = learned(late_s, 8);
  EXPECT_TRUE(errs_less(aligned, late));
  EXPECT_FALSE(errs_less(late, aligned));
}

TEST(HealthySession, OfFrictionThatTheNominalModelHasNothingIsLearned) { EXPECT_TRUE(learned(0, 0).effects.empty()); }

}  // namespace
}  // namespace fxdyn::diagnosis
