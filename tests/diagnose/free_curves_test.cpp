// What has no name gets a curve of the right variable, whose band holds the truth; noise gets none.

#include "host_tools/diagnose/free_curves.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "host_tools/diagnose/curve_squares.hpp"
#include "host_tools/diagnose/curveless.hpp"
#include "host_tools/diagnose/gate.hpp"
#include "host_tools/diagnose/left_curves.hpp"
#include "host_tools/diagnose/linearised.hpp"
#include "host_tools/diagnose/refit.hpp"
#include "host_tools/signals/filter.hpp"
#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A torque of the second joint, of its own position and velocity and of the fourth joint's.
using Torque =
    std::function<ArrayXd(const ArrayXd& q, const ArrayXd& dq, const ArrayXd& other_q, const ArrayXd& other_dq)>;

struct Answer {
  std::vector<FreeCurve> curves;
  std::optional<CurveResult> drawn;
  Models before, after;
  std::vector<SessionLog> logs;

  /// Share of the joint's squared error on the validate log that is left.
  double left(Eigen::Index joint) const {
    return plain_error(after.current, logs)[joint] / plain_error(before.current, logs)[joint];
  }
};

/// @param nominal the robot without the torque; @param extra of the second joint, by log
/// @param inertia of joint 3, in the train log alone, after the first fit [kg*m^2]
/// @param least_width of all joints [rad/s]: slower is at rest
Answer answer_on(const IdentifiedModel& nominal, const std::function<ArrayXd(const SessionLog&)>& extra,
                 double inertia = 0, double least_width = 0) {
  Answer out;
  for (const auto& [role, seed] : {std::pair{Role::train, 1}, std::pair{Role::validate, 2}}) {
    out.logs.push_back(test::small_session_log(nominal, role, static_cast<std::uint64_t>(seed)));
    out.logs.back().log.tau.col(1).array() += extra(out.logs.back());
  }
  Outcome outcome;
  outcome.models = test::around(nominal);
  outcome.models.least_width.assign(6, least_width);
  outcome.whitening = test::no_whitening();
  refit(outcome.models, out.logs, outcome.whitening, 4);
  outcome.look_again(out.logs);
  out.before = out.after = outcome.models;
  ProcessedLog& train = out.logs[0].log;
  train.tau.col(2) += inertia * train.motion(0, train.samples()).ddq.col(2);
  std::vector<bool> without;
  for (std::size_t j = 0; j < 6; ++j) without.push_back(!outcome.structured(j));
  out.curves = add_free_curves(out.after, out.logs, without);
  if (!out.curves.empty()) out.drawn = drawn(out.after, out.curves.front(), out.logs);
  return out;
}

Answer answer(const Torque& torque, double inertia = 0, const IdentifiedModel& nominal = test::fitted_puma(),
              double least_width = 0) {
  const auto extra = [&](const SessionLog& entry) {
    const MotionRows motion = entry.log.motion(0, entry.log.samples());
    return torque(motion.q.col(1).array(), motion.dq.col(1).array(), motion.q.col(3).array(), motion.dq.col(3).array());
  };
  return answer_on(nominal, extra, inertia, least_width);
}

/// A torque of the second joint's own load.
Answer answer_of_load(const std::function<ArrayXd(const ArrayXd& load)>& torque) {
  const IdentifiedModel nominal = test::fitted_puma();
  return answer_on(nominal, [&](const SessionLog& entry) {
    std::vector<SessionLog> logs{entry};
    logs[0].fits = true;
    const Models models = test::around(nominal);
    const Linearised problem(models, logs, test::no_whitening());
    return torque(problem.robot_columns(0).structural().col(1).array());
  });
}

ArrayXd bump(const ArrayXd& x, double at, double width) { return (-((x - at) / width).square()).exp(); }

/// Of the points, those whose band of 95 % holds the truth, whose mean over the points is taken off both.
double held(const CurveResult& curve, const std::function<double(double)>& truth) {
  double mean = 0;
  for (const CurveResult::Point& p : curve.points)
    mean += (truth(p.x) - p.y) / static_cast<double>(curve.points.size());
  double inside = 0;
  for (const CurveResult::Point& p : curve.points) inside += std::fabs(truth(p.x) - mean - p.y) <= 1.96 * p.std;
  return inside / static_cast<double>(curve.points.size());
}

TEST(FreeCurves, ATightSpotIsFrictionOverThePosition) {
  const Answer a = answer([](const ArrayXd& q, const ArrayXd& dq, const ArrayXd&, const ArrayXd&) -> ArrayXd {
    return 2 * bump(q, 0.2, 0.2) * dq.sign();
  });
  ASSERT_EQ(a.curves.size(), 1U);
  EXPECT_EQ(a.curves[0].effect.joint, 1U);
  EXPECT_EQ(a.curves[0].effect.effect, "friction_over_position");
  EXPECT_GT(a.curves[0].odds_nothing, 10);
  ASSERT_TRUE(a.curves[0].odds_rival);
  EXPECT_GT(*a.curves[0].odds_rival, 3);
  EXPECT_LT(a.left(1), 0.3);
  EXPECT_NE(a.drawn->sentence.find("friction rises by"), std::string::npos) << a.drawn->sentence;
  EXPECT_NE(a.drawn->sentence.find("between"), std::string::npos) << a.drawn->sentence;
  EXPECT_GE(held(*a.drawn, [](double q) { return 2 * std::exp(-std::pow((q - 0.2) / 0.2, 2)); }), 0.8);
}

TEST(FreeCurves, ACoverThatPressesIsATorqueOverThePosition) {
  const Answer a = answer([](const ArrayXd& q, const ArrayXd&, const ArrayXd&, const ArrayXd&) -> ArrayXd {
    return 1.5 * bump(q, -0.3, 0.1);
  });
  ASSERT_EQ(a.curves.size(), 1U);
  EXPECT_EQ(a.curves[0].effect.effect, "position_curve");
  EXPECT_LT(a.left(1), 0.3);
  EXPECT_GE(held(*a.drawn, [](double q) { return 1.5 * std::exp(-std::pow((q + 0.3) / 0.1, 2)); }), 0.8);
  EXPECT_NE(a.drawn->sentence.find("torque rises by"), std::string::npos) << a.drawn->sentence;
}

TEST(FreeCurves, AResonanceAtOneSpeedIsACurveOfTheVelocity) {
  const Answer a = answer([](const ArrayXd&, const ArrayXd& dq, const ArrayXd&, const ArrayXd&) -> ArrayXd {
    return 2 * bump(dq, 0.8, 0.15);
  });
  ASSERT_EQ(a.curves.size(), 1U);
  EXPECT_EQ(a.curves[0].effect.effect, "velocity_curve");
  EXPECT_NE(a.drawn->sentence.find("torque rises by"), std::string::npos) << a.drawn->sentence;
  EXPECT_LT(a.left(1), 0.3);
}

TEST(FreeCurves, AHoseThatAnotherJointWindsIsACurveOfItsPosition) {
  const Answer a = answer([](const ArrayXd&, const ArrayXd&, const ArrayXd& other, const ArrayXd&) -> ArrayXd {
    return 2 * (3 * other).sin();
  });
  ASSERT_EQ(a.curves.size(), 1U);
  EXPECT_EQ(a.curves[0].effect.effect, "cross_position");
  EXPECT_EQ(a.curves[0].effect.shape[0], 4);
  EXPECT_EQ(a.drawn->joint, 4U);
  EXPECT_LT(a.left(1), 0.3);
  // A wave has no place of its own.
  EXPECT_NE(a.drawn->sentence.find("torque changes by"), std::string::npos) << a.drawn->sentence;
  EXPECT_NE(a.drawn->sentence.find("of joint 4"), std::string::npos) << a.drawn->sentence;
  EXPECT_GE(held(*a.drawn, [](double q) { return 2 * std::sin(3 * q); }), 0.8);
}

TEST(FreeCurves, WhatAnotherJointsVelocityDoesIsNoneOfThem) {
  const Answer a = answer([](const ArrayXd&, const ArrayXd&, const ArrayXd&, const ArrayXd& speed) -> ArrayXd {
    return 2 * (4 * speed).tanh();
  });
  EXPECT_TRUE(a.curves.empty()) << a.curves[0].effect.effect;
}

/// Of the second joint's acceleration over one log.
ArrayXd acceleration_of(const SessionLog& entry) { return entry.log.motion(0, entry.log.samples()).ddq.col(1).array(); }

TEST(FreeCurves, WhatTheAccelerationDoesIsNoneOfThem) {
  const Answer a = answer_on(test::fitted_puma(), [](const SessionLog& entry) -> ArrayXd {
    const ArrayXd ddq = acceleration_of(entry);
    return 4 * ddq * ddq.abs() / ddq.square().maxCoeff();
  });
  EXPECT_TRUE(a.curves.empty()) << a.curves[0].effect.effect;
}

TEST(VariablesWithoutCurve, HaveTheJerkAmongThem) {
  std::vector<SessionLog> logs{test::small_session_log(test::fitted_puma(), Role::train, 1)};
  logs[0].fits = true;
  const ArrayXd jerk = differentiate(acceleration_of(logs[0]).matrix(), logs[0].log.step_s).array();
  logs[0].log.tau.col(1).array() += 4 * jerk / jerk.abs().maxCoeff();
  const Models models = test::around(test::fitted_puma());
  const Linearised problem(models, logs, test::no_whitening());
  const std::vector<Index> columns = problem.columns_of(in_model(problem));
  const std::vector<VectorXd> moving{VectorXd::Ones(jerk.size())};
  const auto left = [&](std::size_t joint) {
    return left_without_curve(problem, joint, columns, 1e-2, problem.blocks().folds, moving);
  };
  double before = 0;
  for (const Fold& fold : problem.blocks().folds)
    before += judged_with_curves(problem, 1, columns, MatrixXd(problem.solver().rows(1).x.rows(), 0), 0, fold);
  EXPECT_STREQ(left(1).variable, "jerk");
  EXPECT_LT(left(1).left, 0.2 * before);
}

TEST(FreeCurves, ACurveStaysWhereAFitOfEverythingWouldHarmAnotherJoint) {
  const auto cover = [](const ArrayXd& q, const ArrayXd&, const ArrayXd&, const ArrayXd&) -> ArrayXd {
    return 4 * bump(q, -0.3, 0.1);
  };
  const Answer a = answer(cover, 0.1);
  // What the train log alone has of joint 3 would go to the inertia that the validate log has as well.
  Models everything = a.after;
  refit(everything, a.logs, test::no_whitening(), 4);
  ASSERT_TRUE(harmed_joints(a.before.options.gate, a.before.current, everything.current, a.logs)[2]);
  ASSERT_EQ(a.curves.size(), 1U);
  EXPECT_EQ(a.curves[0].effect.effect, "position_curve");
  EXPECT_LT(a.left(1), 0.2);
  EXPECT_NEAR(a.left(2), 1, 1e-9);
}

// Stiction holds any torque: a place that the joint rests in is no place of a torque.
TEST(FreeCurves, WhatIsThereAtRestAloneIsNone) {
  IdentifiedModel nominal = test::fitted_puma();
  nominal.joints[1].sign_width = 0.6;
  const auto held = [](double most) {
    return [most](const ArrayXd&, const ArrayXd& dq, const ArrayXd& other, const ArrayXd&) -> ArrayXd {
      return 4 * (6 * other).sin() * (dq.abs() < most).cast<double>();
    };
  };
  const Answer resting = answer(held(0.55), 0, nominal, 0.6);
  EXPECT_TRUE(resting.curves.empty()) << resting.curves[0].effect.effect;
  EXPECT_FALSE(answer(held(0.55), 0, nominal).curves.empty());
  const Answer moving = answer(held(100), 0, nominal, 0.6);
  ASSERT_EQ(moving.curves.size(), 1U);
  EXPECT_EQ(moving.curves[0].effect.effect, "cross_position");
}

TEST(FreeCurves, ALoadLosesNoMoreThanAllOfIt) {
  const auto loss = [](double height) {
    return [height](const ArrayXd& load) -> ArrayXd { return height * bump(load, 15, 5); };
  };
  const Answer a = answer_of_load(loss(3));
  ASSERT_EQ(a.curves.size(), 1U);
  EXPECT_EQ(a.curves[0].effect.effect, "load_curve");
  for (const FreeCurve& curve : answer_of_load(loss(12)).curves) EXPECT_NE(curve.effect.effect, "load_curve");
}

TEST(FreeCurves, NoiseGetsNone) {
  const Answer a = answer([](const ArrayXd& q, const ArrayXd&, const ArrayXd&, const ArrayXd&) -> ArrayXd {
    return ArrayXd::Zero(q.size());
  });
  EXPECT_TRUE(a.curves.empty());
  EXPECT_EQ(a.after.current->joints[1].effects.size(), a.before.current->joints[1].effects.size());
}

TEST(FreeCurves, WithoutValidateLogsTheModelHasThoseOfASureVariable) {
  std::vector<SessionLog> logs(1);
  CurveResult curve;
  curve.effect = "velocity_curve";
  curve.signal = "dq";
  EXPECT_TRUE(may_enter(curve, logs, GateOptions{}));
  curve.odds_rival = 2.9;
  EXPECT_FALSE(may_enter(curve, logs, GateOptions{}));
  curve.odds_rival = 3.1;
  EXPECT_TRUE(may_enter(curve, logs, GateOptions{}));
  curve.odds_rival = 0.1;
  logs.emplace_back().fits = false;
  EXPECT_TRUE(may_enter(curve, logs, GateOptions{}));
  curve.signal = "t";
  EXPECT_FALSE(may_enter(curve, logs, GateOptions{}));
}

}  // namespace
}  // namespace fxdyn::diagnosis
