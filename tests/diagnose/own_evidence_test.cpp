// What speaks for a name whatever else is missing at its joint, and against several for one thing.

#include "host_tools/diagnose/own_evidence.hpp"

#include <gtest/gtest.h>

#include <functional>

#include "host_tools/diagnose/features.hpp"
#include "host_tools/diagnose/refit.hpp"
#include "host_tools/signals/filter.hpp"
#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::ArrayXd;
using Eigen::MatrixXd;

/// A PUMA 560 with a torque at its second joint, and a model with effects there instead.
/// @param second role of the log that judges; train: both do
std::vector<OwnEvidence> evidence_on(const std::function<ArrayXd(const SessionLog&)>& torque,
                                     const std::vector<EffectFit>& effects, Role second = Role::validate) {
  const IdentifiedModel nominal = test::fitted_puma();
  std::vector<SessionLog> logs;
  for (const auto& [role, seed] : {std::pair{Role::train, 1}, std::pair{second, 2}}) {
    logs.push_back(test::small_session_log(nominal, role, static_cast<std::uint64_t>(seed)));
    logs.back().log.tau.col(1).array() += torque(logs.back());
  }
  Models models = test::around(nominal);
  for (const EffectFit& fit : effects) models.current->joints[1].effects.push_back(fit);
  const Linearised problem(models, logs, test::no_whitening());
  std::vector<MatrixXd> functions(problem.joints());
  for (std::size_t j = 0; j < functions.size(); ++j) functions[j] = features(problem, j);
  return own_evidence(problem, in_model(problem), functions);
}

/// A torque of the second joint, of its own position and of the fourth's [rad].
using TorqueOfPositions = std::function<ArrayXd(const ArrayXd& own, const ArrayXd& other)>;

std::vector<OwnEvidence> evidence(const TorqueOfPositions& torque, const std::vector<EffectFit>& effects,
                                  Role second = Role::validate) {
  const auto of_positions = [&](const SessionLog& entry) {
    return torque(entry.log.q.col(1).array(), entry.log.q.col(3).array());
  };
  return evidence_on(of_positions, effects, second);
}

ArrayXd nothing(const ArrayXd& q) { return ArrayXd::Zero(q.size()); }
ArrayXd wave(const ArrayXd& q) { return (3 * q).sin(); }

TEST(EvidenceOfItsOwn, SpeaksForARippleThatIsThere) {
  const auto own = evidence([](const ArrayXd& q, const ArrayXd&) -> ArrayXd { return 0.4 * (14 * q).cos(); },
                            {test::named_effect("ripple", {14}, {0.4, 0})});
  ASSERT_EQ(own.size(), 1U);
  EXPECT_GT(own[0].gain, 100);
  EXPECT_GT(own[0].form, 0.9);
  EXPECT_EQ(own[0].alike, 1U);
}

TEST(EvidenceOfItsOwn, DoesNotSpeakForOneThatIsNot) {
  const auto own = evidence([](const ArrayXd& q, const ArrayXd&) -> ArrayXd { return nothing(q); },
                            {test::named_effect("ripple", {14}, {0.1, 0})});
  EXPECT_LT(own[0].gain, 16);
}

// Another joint's position moves this one's torque ten times as much as the ripple does, and no effect says so.
TEST(EvidenceOfItsOwn, SpeaksForANameBesideSomethingLargeOfAnotherVariable) {
  const auto own =
      evidence([](const ArrayXd& q, const ArrayXd& other) -> ArrayXd { return 0.3 * (14 * q).cos() + 3 * wave(other); },
               {test::named_effect("ripple", {14}, {0.3, 0})});
  EXPECT_GT(own[0].gain, 16);
  EXPECT_GT(own[0].form, 0.8);
}

TEST(EvidenceOfItsOwn, DoesNotSpeakForANameThatOnlyResemblesWhatIsMissing) {
  const auto own = evidence([](const ArrayXd&, const ArrayXd& other) -> ArrayXd { return 3 * wave(other); },
                            {test::named_effect("viscous_cubic", {}, {0.05})});
  EXPECT_LT(own[0].gain, 16);
}

// Where a joint turns round, its jerk is as sudden as its friction.
TEST(EvidenceOfItsOwn, FrictionLosesAgainstTheJerk) {
  const auto torque = [](const SessionLog& entry) -> ArrayXd {
    const ProcessedLog& log = entry.log;
    const ArrayXd jerk = differentiate(log.motion(0, log.samples()).ddq.col(1), log.step_s).array();
    return 2 * jerk / jerk.abs().maxCoeff();
  };
  const auto own = evidence_on(torque, {test::named_effect("presliding", {0.02}, {-1})});
  EXPECT_LT(own[0].form, 0.5);
  EXPECT_GT(own[0].curve_gain, 100);
}

// The inertia of a joint that carries one link is the same in every position. Seen through a gear that bends, it may do
// the gear's work: what speaks for the gear is against a model without it.
TEST(EvidenceOfItsOwn, SpeaksForAGearThatAnInertiaSeenThroughItImitates) {
  Models models = test::around(test::fitted_puma(1));
  models.current->joints[0].effects.push_back(test::named_effect("elasticity", {0.02}, {0.3}));
  bring_rotor(models, {.joint = 0, .in_base = hidden_rotor(models.current, 0)}, 0.1);
  std::vector<SessionLog> logs;
  for (const auto& [role, seed] : {std::pair{Role::train, 1}, std::pair{Role::validate, 2}})
    logs.push_back(test::small_session_log(models.current, role, static_cast<std::uint64_t>(seed)));
  const Linearised problem(models, logs, test::no_whitening(1));
  const std::vector<OwnEvidence> own = own_evidence(problem, in_model(problem), {features(problem, 0)});
  EXPECT_GT(own[0].gain, 100);
  EXPECT_GT(own[0].form, 0.9);
}

// A bump over a tenth of the range: three ripples close a part of it, a free curve of the position all.
TEST(EvidenceOfItsOwn, SeveralNamesForOneBumpAreWorseThanACurve) {
  const auto bump = [](const ArrayXd& q, const ArrayXd&) -> ArrayXd {
    return 2 * (-((q - 0.2) / 0.08).square()).exp();
  };
  const auto own =
      evidence(bump, {test::named_effect("ripple", {2}, {0.3, 0.1}), test::named_effect("ripple", {4}, {0.3, 0.1}),
                      test::named_effect("ripple", {6}, {0.3, 0.1})});
  ASSERT_EQ(own.size(), 3U);
  for (const OwnEvidence& one : own) {
    EXPECT_EQ(one.alike, 3U);
    EXPECT_LT(one.form, 0.8);
    EXPECT_GT(one.gain, 16);  // each brings something: that alone is no proof of a name
  }
}

// A stop pushes back beyond a position. A compensator and a spring close most of that, a curve of the position all of
// it: also where two logs judge one another, of which neither shows all that the other has.
TEST(EvidenceOfItsOwn, TwoNamesForAStopLoseAgainstACurve) {
  const auto stop = [](const ArrayXd& q, const ArrayXd&) -> ArrayXd { return -6 * (q - 0.3).max(0.0); };
  for (const Role second : {Role::validate, Role::train}) {
    const auto own = evidence(
        stop, {test::named_effect("gravity_compensator", {}, {0.5, 0.5}), test::named_effect("spring", {}, {-1, 0})},
        second);
    ASSERT_EQ(own.size(), 2U);
    for (const OwnEvidence& one : own) {
      EXPECT_TRUE(one.of_position);
      EXPECT_GT(one.curve_gain, 14);
    }
  }
}

// The more names, the more they close. A free curve in their place is likelier all the same.
TEST(EvidenceOfItsOwn, ThreeNamesForAStopLoseAgainstOneCurve) {
  const auto stop = [](const ArrayXd& q, const ArrayXd&) -> ArrayXd { return -6 * (q - 0.3).max(0.0); };
  const auto own =
      evidence(stop, {test::named_effect("gravity_compensator", {}, {0.5, 0.5}),
                      test::named_effect("spring", {}, {-1, 0}), test::named_effect("ripple", {5}, {0.3, 0.1})});
  ASSERT_EQ(own.size(), 3U);
  for (const OwnEvidence& one : own) {
    EXPECT_GT(one.form, GateOptions{}.several_closure);
    EXPECT_GT(one.spline_gain, 14);
  }
}

TEST(EvidenceOfItsOwn, TwoNamesForWhatTheyAreDoNot) {
  const auto both = [](const ArrayXd& q, const ArrayXd&) -> ArrayXd { return 3 * q + 5 * (14 * q).cos(); };
  for (const Role second : {Role::validate, Role::train}) {
    const auto own =
        evidence(both, {test::named_effect("spring", {}, {3, 0}), test::named_effect("ripple", {14}, {5, 0})}, second);
    ASSERT_EQ(own.size(), 2U);
    for (const OwnEvidence& one : own) {
      EXPECT_LT(one.curve_gain, 0);
      EXPECT_LT(one.spline_gain, 0);
      EXPECT_GT(one.form, 0.95);
    }
  }
}

// On a real robot something else is always missing.
TEST(EvidenceOfItsOwn, TwoNamesForWhatTheyAreHoldBesideASmallBump) {
  const auto both = [](const ArrayXd& q, const ArrayXd&) -> ArrayXd {
    return 3 * q + 5 * (14 * q).cos() + 0.5 * (-((q - 0.2) / 0.08).square()).exp();
  };
  const auto own =
      evidence(both, {test::named_effect("spring", {}, {3, 0}), test::named_effect("ripple", {14}, {5, 0})});
  ASSERT_EQ(own.size(), 2U);
  for (const OwnEvidence& one : own) {
    EXPECT_GT(one.curve_gain, 14);
    EXPECT_GT(one.form, GateOptions{}.several_closure);
    EXPECT_LT(one.spline_gain, 0);
  }
}

/// How well the form of a tilt holds on a PUMA 560 that has one, and an effect at joint 2 beside it.
/// @param share of the tilt's torque that joint 3 has
/// @param tilt about x and y [rad]
double form_of_tilt(double share, const std::vector<EffectFit>& at_joint, std::vector<double> tilt = {0.02, 0.03}) {
  const IdentifiedModel nominal = test::fitted_puma();
  IdentifiedModel upright = nominal;
  for (const EffectFit& fit : at_joint) upright.joints[1].effects.push_back(fit);
  IdentifiedModel tilted = upright;
  tilted.body.push_back(test::named_effect("gravity_tilt", {}, std::move(tilt)));
  std::vector<SessionLog> logs;
  for (const auto& [role, seed] : {std::pair{Role::train, 1}, std::pair{Role::validate, 2}}) {
    const SessionLog without = test::small_session_log(upright, role, static_cast<std::uint64_t>(seed));
    logs.push_back(test::small_session_log(tilted, role, static_cast<std::uint64_t>(seed)));
    MatrixXd& tau = logs.back().log.tau;
    tau.col(2) = without.log.tau.col(2) + share * (tau.col(2) - without.log.tau.col(2));
  }
  Models models = test::around(nominal);
  models.current->body.push_back(test::named_effect("gravity_tilt", {}, {0.01, 0.01}));
  Linearised problem(models, logs, test::no_whitening());
  const std::vector<std::size_t> groups = in_model(problem);
  return form_on_robot(problem, groups, groups.at(0));
}

TEST(FormOnTheRobot, HoldsForWhatAllJointsHaveInCommonWhateverElseOneLacks) {
  EXPECT_GT(form_of_tilt(1, {}), 0.95);
  EXPECT_GT(form_of_tilt(1, {test::named_effect("ripple", {14}, {3, 0})}), 0.8);
}

// One joint's coefficients are as good as common ones where no other joint judges them.
TEST(FormOnTheRobot, DoesNotHoldForWhatOneJointAloneLacks) {
  EXPECT_LT(form_of_tilt(1, {test::named_effect("ripple", {1}, {3, 0})}, {0, 0}), 0.8);
}

TEST(FormOnTheRobot, DoesNotHoldWhereAJointFeelsItOtherwise) { EXPECT_LT(form_of_tilt(-1, {}), 0.8); }

}  // namespace
}  // namespace fxdyn::diagnosis
