// What an encoder's steps make of a motion, and of the friction that follows it.

#include "host_tools/diagnose/encoder_error.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "host_tools/diagnose/features.hpp"
#include "host_tools/diagnose/lack_of_fit.hpp"
#include "host_tools/signals/filter.hpp"
#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::MatrixXd;

constexpr double encoder_step = 2e-3;

/// The log of a PUMA 560 as encoders with such steps show it, with a spring of this stiffness at joint 5 [N*m/rad].
SessionLog seen_through_steps(double stiffness = 0) {
  IdentifiedModel robot = test::fitted_puma();
  if (stiffness > 0) robot.joints[4].effects.push_back(test::effect("spring", {}, {stiffness, 0}));
  SessionLog out = test::small_session_log(robot, Role::train, 1);
  ProcessedLog& log = out.log;
  const ZeroPhaseFilter filter(log.filter.position_cutoff_hz, log.step_s);
  for (auto q : log.q.colwise()) q = filter.apply(((q.array() / encoder_step).round() * encoder_step).matrix());
  log.filter.encoder_step.assign(6, encoder_step);
  return out;
}

TEST(SeenAgain, IsNothingWhereEncodersHaveNoSteps) {
  SessionLog exact = test::small_session_log(test::fitted_puma(), Role::train, 1);
  const MatrixXd q = exact.log.q;
  EXPECT_FALSE(see_again(exact.log));
  EXPECT_EQ(exact.log.q, q);
  SessionLog measured = seen_through_steps();
  measured.log.measured_dq = measured.log.q;  // tells which way it moves
  EXPECT_FALSE(see_again(measured.log));
}

TEST(SeenAgain, DiffersByLessThanAStep) {
  ProcessedLog log = seen_through_steps().log;
  const MatrixXd before = log.q;
  const auto moved = see_again(log);
  ASSERT_TRUE(moved);
  const MatrixXd error = log.q - moved->q;
  EXPECT_LT(error.cwiseAbs().maxCoeff(), encoder_step);
  // Uniform rounding has step / sqrt(12); the filter takes most of it where steps come fast.
  EXPECT_GT(test::rms(error), 0.02 * encoder_step);
  EXPECT_LT(test::rms(error), encoder_step / std::sqrt(12.0));
  EXPECT_LT(test::rms(moved->q - before), encoder_step);
}

TEST(SeenAgain, CountsTheSamplesOfTheRecording) {
  const auto error_of_velocity = [](Eigen::Index kept_each) {
    ProcessedLog log = seen_through_steps().log;
    log.kept_each = kept_each;
    const auto moved = see_again(log);
    return test::rms(log.motion().dq - moved->dq);
  };
  // Thinned: each sample is the mean of four times as many steps.
  EXPECT_LT(error_of_velocity(4), error_of_velocity(1));
}

/// The chance that noise looks as much like structure of a joint.
double chance(const SessionLog& entry, std::size_t joint) {
  const std::vector<SessionLog> logs{entry};
  const Linearised problem(test::around(test::fitted_puma()), logs, test::no_whitening());
  const LinearFit fit = problem.solver().solve(problem.nuisance());
  return lack_of_fit(problem, joint, fit, nullptr, features(problem, joint)).state_p;
}

TEST(SeenAgain, MakesNoStructureOfTheRobot) {
  SessionLog unknown = seen_through_steps();
  unknown.log.filter.encoder_step.assign(6, 0.0);
  EXPECT_LT(chance(unknown, 1), LackOfFitOptions{}.state);
  EXPECT_GT(chance(seen_through_steps(), 1), LackOfFitOptions{}.state);
  // Whose inertia is large: noise of its acceleration is most of the residual.
  EXPECT_LT(chance(unknown, 0), 1e-35);
  EXPECT_GT(chance(seen_through_steps(), 0), 1e-12);
  // A spring is more than the steps make.
  EXPECT_LT(chance(seen_through_steps(3), 4), 1e-20);
}

}  // namespace
}  // namespace fxdyn::diagnosis
