// The motion that decides what a diagnosis left open.

#include "host_tools/excite/next_motion.hpp"

#include <gtest/gtest.h>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/excite/nominal.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

class NextMotion : public testing::Test {
 protected:
  NextMotion() {
    model_.filter.torque_cutoff_hz = 10;
    options_.draws = 4;
    options_.generations = 2;
  }
  NextMotions plan(const OpenQuestions& questions) {
    Progress progress;
    return plan_next(project_, model_, questions, Eigen::Vector2d(0.3, 0.1), "/nonexistent", progress, options_);
  }
  static EffectQuestion viscous_or(const std::string& rival, double coefficient) {
    return {{"viscous_quadratic", 1, {}}, Eigen::VectorXd::Constant(1, coefficient), 0, rival, 1, {}, "likely"};
  }

  Project project_ =
      read_project(test::write("next.toml", "[robot]\nurdf = \"" FXDYN_SOURCE_DIR
                                            "/tests/support/elastic_arm/arm.urdf\"\nrated_torque = [60, 20]\n"
                                            "[limits]\nacceleration = [8, 8]\n"));
  IdentifiedModel model_ = nominal_from_urdf(project_.robot, {60, 20}, {2, 2}).model;
  NextMotionOptions options_;
};

TEST_F(NextMotion, OddsGrowWithTheSquareOfTheEffect) {
  options_.generations = 0;
  options_.most_motions = 1;
  const NextMotions once = plan({{viscous_or("", 0.1)}, {}}), twice = plan({{viscous_or("", 0.2)}, {}});
  ASSERT_EQ(once.trajectories.size(), twice.trajectories.size());
  EXPECT_GT(once.odds[0], 0);
  EXPECT_NEAR(twice.odds[0], 4 * once.odds[0], 1e-6 * twice.odds[0]);
}

TEST_F(NextMotion, ARivalTakesPartOfTheOdds) {
  const NextMotions alone = plan({{viscous_or("", 1)}, {}}), beside = plan({{viscous_or("viscous_cubic", 1)}, {}});
  EXPECT_GT(beside.odds[0], 0);
  EXPECT_LT(beside.usual[0], 0.5 * alone.usual[0]);
}

TEST_F(NextMotion, IsBetterThanTheUsualOne) {
  options_.draws = 12;
  const NextMotions next = plan({{viscous_or("viscous_cubic", 1)}, {}});
  EXPECT_GT(next.odds[0], next.usual[0]);
  EXPECT_FALSE(next.hopeless[0]);
}

TEST_F(NextMotion, PlansNothingForWhatMotionDoesNotDecide) {
  const NextMotions next = plan({{{{"payload", 0, {}}, {}, 0.01, "", 0, {}, "not_identifiable"}}, {}});
  EXPECT_TRUE(next.hopeless[0]);
  EXPECT_TRUE(next.trajectories.empty());
}

TEST_F(NextMotion, StaysWhereTheGapSits) {
  const PlaceQuestion place{1, 1, "q", 0.2, 0.4};
  const NextMotions next = plan({{}, {place}});
  ASSERT_FALSE(next.trajectories.empty());
  // All of the interval, not one point of it.
  double lowest = 1, highest = 0;
  for (const PlannedTrajectory& one : next.trajectories) {
    for (const double q : one.q.col(1)) {
      if (q < 0.2 || q > 0.4) continue;
      lowest = std::min(lowest, q);
      highest = std::max(highest, q);
    }
  }
  EXPECT_LT(lowest, 0.22);
  EXPECT_GT(highest, 0.38);
  EXPECT_GT(next.seconds[0], 0.6 * options_.enough_s);
}

TEST_F(NextMotion, SaysSoWhereNoMotionComes) {
  const NextMotions next = plan({{}, {{1, 1, "q", 90, 91}}});
  EXPECT_TRUE(next.hopeless_places[0]);
  EXPECT_TRUE(next.trajectories.empty());
}

TEST_F(NextMotion, AHealthySessionTellsALoadFromTheLastLink) {
  OpenQuestions questions{{{{"payload", 0, {}}, {}, 0.05, "", 0, {}, "likely"}}, {}};
  EXPECT_TRUE(plan(questions).hopeless[0]);
  questions.known_base = true;
  EXPECT_FALSE(plan(questions).hopeless[0]);
}

}  // namespace
}  // namespace fxdyn
