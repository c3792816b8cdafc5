// What is found at one joint makes its rows weigh more in the base parameters that others have in common with it.

#include "host_tools/diagnose/harmless.hpp"

#include <gtest/gtest.h>

#include "host_tools/diagnose/plain_error.hpp"
#include "host_tools/diagnose/refit.hpp"
#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

/// A PUMA whose second joint has cubic friction that the nominal model lacks, and as much of the third link's weight
/// beside what the third joint feels of it as the noise is large: no model has both.
class FriendlyFire : public ::testing::Test {
 protected:
  static constexpr std::size_t joint = 1;
  static constexpr double cubic = 30;

  FriendlyFire() {
    const IdentifiedModel robot = test::fitted_puma();
    for (const auto& [role, seed] : {std::pair{Role::train, 1}, std::pair{Role::validate, 2}}) {
      logs_.push_back(test::small_session_log(robot, role, static_cast<std::uint64_t>(seed)));
      ProcessedLog& log = logs_.back().log;
      const auto motion = log.motion(0, log.samples());
      log.tau.col(joint).array() +=
          cubic * motion.dq.col(joint).array().cube() + 0.2 * (motion.q.col(1) + motion.q.col(2)).array().sin();
    }
    Models models = test::around(robot);
    refit(models, logs_, test::no_whitening(), 8);
    nominal_ = models.current;
    outcome_.models = models;
    outcome_.models.current->joints[joint].effects.push_back(test::named_effect("viscous_cubic", {}, {cubic}));
    outcome_.whitening = test::no_whitening();
    outcome_.found.push_back({.id = {false, joint, nominal_.joints[joint].effects.size()}, .alternatives = {}});
    refit(outcome_.models, logs_, outcome_.whitening, 8);
    outcome_.look_again(logs_);
  }
  std::size_t harmed() const {
    return count_harmed(outcome_.models.options.gate, nominal_, outcome_.models.current, logs_);
  }

  std::vector<SessionLog> logs_;
  IdentifiedModel nominal_;
  Outcome outcome_;
};

TEST_F(FriendlyFire, IsHeldBackToTheJointWhereSomethingWasFound) {
  ASSERT_GT(harmed(), 0U);
  const double before = plain_error(nominal_, logs_)[joint];
  ASSERT_TRUE(fit_without_harm(outcome_, nominal_, logs_));
  EXPECT_EQ(harmed(), 0U);
  const IdentifiedModel& now = outcome_.models.current;
  for (std::size_t c = 0; c < now.base.size(); ++c) EXPECT_NEAR(now.base[c].value, nominal_.base[c].value, 1e-12) << c;
  for (std::size_t j = 0; j < now.joints.size(); ++j) {
    if (j == joint) continue;
    for (std::size_t e = 0; e < now.joints[j].effects.size(); ++e)
      EXPECT_EQ(now.joints[j].effects[e].linear, nominal_.joints[j].effects[e].linear) << j;
  }
  EXPECT_NEAR(now.joints[joint].effects.back().linear[0], cubic, 0.01 * cubic);
  EXPECT_LT(plain_error(now, logs_)[joint], 0.01 * before);
}

TEST_F(FriendlyFire, ALoadIsAllJointsAndIsNotHeldBack) {
  outcome_.models.current->body.push_back(test::named_effect("payload", {}, {1e-3, 0, 0, 0}));
  outcome_.found.push_back({.id = {true, 0, 0}, .alternatives = {}});
  outcome_.look_again(logs_);
  EXPECT_FALSE(fit_without_harm(outcome_, nominal_, logs_));
}

}  // namespace
}  // namespace fxdyn::diagnosis
