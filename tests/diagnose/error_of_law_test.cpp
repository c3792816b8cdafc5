// What the smooth sign of the nominal friction may leave.

#include "host_tools/diagnose/error_of_law.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "host_tools/diagnose/explore.hpp"
#include "host_tools/diagnose/refit.hpp"
#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

/// A PUMA 560 whose second joint has dry friction of 20 N*m.
class ErrorOfLaw : public testing::Test {
 protected:
  using Torque = std::function<double(double dq, double other_q)>;

  /// With a further torque of that joint: whether structure is seen there, and whether it is no more than an error.
  bool is_error(const Torque& torque, double friction = 20) {
    IdentifiedModel robot = test::fitted_puma();
    for (EffectFit& fit : robot.joints[1].effects) {
      if (fit.effect == "coulomb") fit.linear[0] = friction;
    }
    robot.joints[1].sign_width = 0.05;
    std::vector<SessionLog> logs;
    for (const auto& [role, seed] : {std::pair{Role::train, 1}, std::pair{Role::validate, 2}}) {
      logs.push_back(test::small_session_log(robot, role, static_cast<std::uint64_t>(seed)));
      ProcessedLog& log = logs.back().log;
      const MotionRows motion = log.motion();
      for (Eigen::Index k = 0; k < log.samples(); ++k) log.tau(k, 1) += torque(motion.dq(k, 1), motion.q(k, 3));
    }
    Outcome outcome;
    outcome.models = test::around(robot);
    outcome.whitening = test::no_whitening();
    refit(outcome.models, logs, outcome.whitening, 4);
    outcome.look_again(logs);
    EXPECT_TRUE(outcome.structured(1));
    const Gate gate = judge_again(outcome, logs, std::vector<bool>(6, false));
    return gate.of_law[1];
  }
};

TEST_F(ErrorOfLaw, IsASmallFunctionOfTheOwnMotion) {
  const auto of_speed = [](double size) { return [size](double dq, double) { return size * std::sin(6 * dq); }; };
  EXPECT_TRUE(is_error(of_speed(0.5)));
  EXPECT_FALSE(is_error(of_speed(0.5), 4)) << "of little friction it is much";
  EXPECT_FALSE(is_error(of_speed(5)));
}

TEST_F(ErrorOfLaw, IsNoneOfAnotherJointsPosition) {
  EXPECT_FALSE(is_error([](double, double other_q) { return 0.5 * std::sin(6 * other_q); }));
}

}  // namespace
}  // namespace fxdyn::diagnosis
