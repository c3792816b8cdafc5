// Names on data that fitted no coefficient, and what diagnosis.json says of them.

#include "host_tools/diagnose/gate.hpp"
#include "host_tools/diagnose/certainty.hpp"
#include "host_tools/diagnose/explore.hpp"
#include "host_tools/diagnose/left_curves.hpp"
#include "host_tools/diagnose/refit.hpp"
#include "host_tools/diagnose/vanished.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "host_tools/diagnose/verdict.hpp"
#include "host_tools/support/progress.hpp"
#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

using nlohmann::json;

/// A PUMA 560 that has a ripple at joint 2, and a model with that and a spring at joint 3, which it does not have.
class NamesAtTheGate : public testing::Test {
 protected:
  NamesAtTheGate() : nominal_(test::fitted_puma()) {
    IdentifiedModel robot = nominal_;
    robot.joints[1].effects.push_back(test::effect("ripple", {14}, {0.5, 0.2}));
    for (const auto& [role, seed] : {std::pair{Role::train, 1}, std::pair{Role::validate, 2}}) {
      logs_.push_back(test::small_session_log(robot, role, static_cast<std::uint64_t>(seed)));
      processed_.push_back(logs_.back().log);
    }
    outcome_.models = test::around(nominal_);
    auto& joints = outcome_.models.current->joints;
    joints[1].effects.push_back(test::named_effect("ripple", {14}, {0.5, 0.2}));
    joints[2].effects.push_back(test::named_effect("spring", {}, {0.01, 0}));
    outcome_.found = {{{false, 1, joints[1].effects.size() - 1}, 100, {}},
                      {{false, 2, joints[2].effects.size() - 1}, 10, {}}};
    outcome_.whitening = test::no_whitening();
    outcome_.not_identifiable.resize(7);
    outcome_.look_again(logs_);
  }
  DiagnosisResult result(const Gate& gate, const std::vector<ProcessedLog>& test = {}) const {
    const Deflections deflections;
    const std::vector<std::optional<Impacts>> impacts(6);
    const Curves curves(6);
    return verdicts({nominal_,
                     outcome_.models.current,
                     outcome_,
                     gate,
                     judged_by(gate, *outcome_.problem),
                     doubtful_shares(*outcome_.problem),
                     {},
                     deflections,
                     impacts,
                     curves,
                     still_,
                     processed_,
                     test});
  }

  IdentifiedModel nominal_;
  std::vector<SessionLog> logs_;
  std::vector<ProcessedLog> processed_;
  Outcome outcome_;
  const std::vector<bool> still_ = std::vector<bool>(6, false);
};

TEST_F(NamesAtTheGate, OnlyWhatBringsSomethingStays) {
  const Gate gate = pass(outcome_, nominal_, logs_, still_);
  ASSERT_EQ(gate.groups.size(), 1U);
  ASSERT_EQ(outcome_.found.size(), 1U);
  EXPECT_EQ(outcome_.problem->groups()[gate.groups[0]].candidate.effect, "ripple");
  EXPECT_EQ(outcome_.models.current->joints[2].find("spring"), nullptr);
  EXPECT_GT(gate.closure[1], 0.9);
  EXPECT_TRUE(gate.accepted[1]);
  EXPECT_FALSE(gate.remains[1]);
  EXPECT_GT(gate.held.before[1], 1.5 * gate.held.after[1]);
  EXPECT_NEAR(gate.held.alone[0][1], gate.held.before[1] - gate.held.after[1], 0.1 * gate.held.before[1]);
  EXPECT_EQ(gate.place(*outcome_.problem, outcome_.found[0].id), 0U);

  weigh_evidence(outcome_, gate);
  const Evidence& evidence = outcome_.found[0].evidence;
  EXPECT_GT(evidence.against_nothing, 10);
  EXPECT_GT(evidence.deviations, 10);
  EXPECT_TRUE(evidence.there);
  EXPECT_EQ(evidence.certainty, Certainty::established);

  const json report = to_json(result(gate));
  EXPECT_EQ(report.at("verdict"), "explained") << report.dump(1);
  EXPECT_EQ(report.at("gate"), "validate logs");
  const json& joint = report.at("joints").at(1);
  EXPECT_EQ(joint.at("verdict"), "explained");
  ASSERT_EQ(joint.at("effects").size(), 1U);
  EXPECT_EQ(joint.at("effects").at(0).at("effect"), "ripple");
  EXPECT_EQ(joint.at("effects").at(0).at("certainty"), "established");
  EXPECT_LT(joint.at("left").at("share"), 0.1);
  EXPECT_LE(joint.at("left").at("low"), joint.at("left").at("share"));
  EXPECT_GE(joint.at("left").at("high"), joint.at("left").at("share"));
  EXPECT_TRUE(joint.at("carries_over").is_null());  // no test logs
  EXPECT_LT(joint.at("gap_after"), 0.3 * joint.at("gap_before").get<double>());
  EXPECT_EQ(report.at("joints").at(2).at("verdict"), "nothing_missing");
}

/// A PUMA 560 whose second joint runs into a stop, which has three names, beside a ripple of the third.
/// @param second role of the log that judges; train: both do
Outcome with_a_stack(Role second, std::vector<SessionLog>& logs) {
  const IdentifiedModel nominal = test::fitted_puma();
  IdentifiedModel robot = nominal;
  robot.joints[2].effects.push_back(test::effect("ripple", {14}, {0.5, 0.2}));
  for (const auto& [role, seed] : {std::pair{Role::train, 1}, std::pair{second, 2}}) {
    logs.push_back(test::small_session_log(robot, role, static_cast<std::uint64_t>(seed)));
    ProcessedLog& log = logs.back().log;
    log.tau.col(1).array() -= 6 * (log.q.col(1).array() - 0.3).max(0.0);
  }
  Outcome out;
  out.models = test::around(nominal);
  auto& joints = out.models.current->joints;
  for (const EffectFit& fit :
       {test::named_effect("gravity_compensator", {}, {0.5, 0.5}), test::named_effect("spring", {}, {-1, 0}),
        test::named_effect("ripple", {5}, {0.3, 0.1})}) {
    joints[1].effects.push_back(fit);
    out.found.push_back({{false, 1, joints[1].effects.size() - 1}, 100, {}});
  }
  joints[2].effects.push_back(test::named_effect("ripple", {14}, {0.5, 0.2}));
  out.found.push_back({{false, 2, joints[2].effects.size() - 1}, 100, {}});
  out.whitening = test::no_whitening();
  out.not_identifiable.resize(7);
  refit(out.models, logs, out.whitening, 4);
  out.look_again(logs);
  return out;
}

TEST(AStackAtTheGate, IsTakenOutWhereALogCanConfirmTheCurveInItsPlace) {
  std::vector<SessionLog> logs;
  Outcome outcome = with_a_stack(Role::validate, logs);
  const Gate gate = pass(outcome, test::fitted_puma(), logs, std::vector<bool>(6, false));
  ASSERT_EQ(outcome.found.size(), 1U);
  const EffectId& id = outcome.found[0].id;
  EXPECT_EQ(id.joint, 2U);
  EXPECT_EQ(outcome.models.current->joints[2].effects.at(id.effect).effect, "ripple");
  for (const char* gone : {"gravity_compensator", "spring", "ripple"})
    EXPECT_EQ(outcome.models.current->joints[1].find(gone), nullptr) << gone;
}

TEST(AStackAtTheGate, HasNoNamesWhateverItCloses) {
  std::vector<SessionLog> logs;
  Outcome outcome = with_a_stack(Role::train, logs);
  const Gate gate = judge_again(outcome, logs, std::vector<bool>(6, false));
  weigh_evidence(outcome, gate);
  ASSERT_EQ(outcome.found.size(), 4U);
  for (const Finding& finding : outcome.found) {
    if (finding.id.joint != 1) continue;
    EXPECT_FALSE(gate.believed[gate.place(*outcome.problem, finding.id)]);
    EXPECT_EQ(finding.evidence.certainty, Certainty::unlisted);
  }
  EXPECT_TRUE(gate.remains[1]);
}

TEST_F(NamesAtTheGate, NothingStaysBelowItsThresholds) {
  outcome_.models.options.gate.least_gain = 1e6;
  EXPECT_TRUE(pass(outcome_, nominal_, logs_, still_).groups.empty());
}

TEST_F(NamesAtTheGate, WhatTheFitTookToNothingGoesWhateverALinearFitSays) {
  auto& joints = outcome_.models.current->joints;
  joints[2].effects.pop_back();  // else a fit without it would find the ripple again
  outcome_.found.pop_back();
  joints[1].effects[outcome_.found[0].id.effect].linear = {1e-9, -1e-9};
  outcome_.look_again(logs_);
  EXPECT_GT(judge_again(outcome_, logs_, still_).held.alone[0][1], outcome_.models.options.gate.least_gain);
  const std::optional<EffectId> vanished = vanished_finding(outcome_, outcome_.models.current);
  ASSERT_TRUE(vanished);
  EXPECT_EQ(*vanished, outcome_.found[0].id);
  EXPECT_TRUE(pass(outcome_, nominal_, logs_, still_).groups.empty());
}

TEST_F(NamesAtTheGate, NothingIsBelievedThatClosesTooLittle) {
  outcome_.models.options.gate.least_closure = outcome_.models.options.gate.sure_closure = 1.1;
  const Gate gate = pass(outcome_, nominal_, logs_, still_);
  ASSERT_EQ(gate.groups.size(), 1U);
  EXPECT_FALSE(gate.accepted[1]);
}

TEST_F(NamesAtTheGate, ANameThatTheTestLogsDoNotBearOutIsToldWithBothErrors) {
  const Gate gate = pass(outcome_, nominal_, logs_, still_);
  weigh_evidence(outcome_, gate);
  const auto joint = [&](double ripple) {
    IdentifiedModel robot = nominal_;
    robot.joints[1].effects.push_back(test::effect("ripple", {14}, {ripple, 0.4 * ripple}));
    const std::vector<ProcessedLog> test{test::small_session_log(robot, Role::test, 3).log};
    return to_json(result(gate, test));
  };
  const json other = joint(-0.5), same = joint(0.5);
  const json &shows = other.at("joints").at(1), &bears_out = same.at("joints").at(1);
  EXPECT_EQ(shows.at("carries_over"), false);
  EXPECT_EQ(bears_out.at("carries_over"), true);
  // Nothing is found there, and it keeps what it shares with the joint where something is.
  EXPECT_TRUE(other.at("joints").at(2).at("carries_over").is_null());
  // Test logs change no verdict.
  EXPECT_EQ(shows.at("verdict"), "explained");
  EXPECT_GT(shows.at("gap_after"), 1.5 * shows.at("gap_before").get<double>());
  EXPECT_LT(shows.at("gate_after"), 0.5 * shows.at("gate_before").get<double>());
  EXPECT_EQ(shows.at("gate_after"), bears_out.at("gate_after"));
  EXPECT_LE(shows.at("noise_floor"), shows.at("gap_before"));
  EXPECT_NE(other.at("notes").dump().find("on the logs that judged it goes from"), std::string::npos)
      << other.at("notes");
}

TEST_F(NamesAtTheGate, WhatRaisesAJointsErrorGoesEvenIfItPassedBefore) {
  EXPECT_FALSE(harmful_finding(outcome_, nominal_, outcome_.models.current, logs_));
  IdentifiedModel worse = nominal_;
  worse.joints[1].effects.push_back(test::effect("ripple", {14}, {-0.5, -0.2}));
  const std::optional<EffectId> gone = harmful_finding(outcome_, nominal_, worse, logs_);
  ASSERT_TRUE(gone);
  EXPECT_EQ(gone->joint, 1U);  // though the spring at joint 3 has less evidence
  take_out(outcome_, *gone, logs_);
  ASSERT_EQ(outcome_.found.size(), 1U);
  EXPECT_EQ(outcome_.found[0].id.joint, 2U);
  EXPECT_EQ(outcome_.models.current->joints[1].find("ripple"), nullptr);
}

TEST_F(NamesAtTheGate, StayWhereAFitInTheWholeBandCuresAJoint) {
  Models nominal = test::around(nominal_);
  refit(nominal, logs_, test::no_whitening(), 8);
  for (EffectFit& fit : outcome_.models.current->joints[1].effects) {
    if (fit.effect == "viscous") fit.linear[0] += 2;  // as whitened rows may have it
  }
  outcome_.look_again(logs_);
  const auto harmed = [&] {
    return harmed_joints(outcome_.models.options.gate, nominal.current, outcome_.models.current, logs_);
  };
  ASSERT_TRUE(harmed()[1]);
  pass(outcome_, nominal.current, logs_, still_);
  ASSERT_EQ(outcome_.found.size(), 1U);
  EXPECT_NE(outcome_.models.current->joints[1].find("ripple"), nullptr);
  EXPECT_FALSE(harmed()[1]);
}

/// A ripple that joint 2 has, and a load that no link has.
TEST_F(NamesAtTheGate, OfSeveralThatMayHarmAJointTheOneGoesWithoutWhichLeastIsHarmed) {
  IdentifiedModel& model = outcome_.models.current;
  model.joints[2].effects.pop_back();
  model.body.push_back(test::named_effect("payload", {}, {3, 0.1, 0.1, 0.1}));
  outcome_.found = {{{false, 1, model.joints[1].effects.size() - 1}, 100, {}}, {{true, 0, 0}, 1000, {}}};
  outcome_.look_again(logs_);
  pass(outcome_, nominal_, logs_, still_);
  ASSERT_EQ(outcome_.found.size(), 1U);
  EXPECT_TRUE(model.body.empty());
  EXPECT_NE(model.joints[1].find("ripple"), nullptr);
}

/// A finding at joint 2 that its rival comes near to.
class Rivals : public NamesAtTheGate {
 protected:
  void settle(const EffectFit& chosen, const EffectFit& rival) {
    IdentifiedModel& model = outcome_.models.current;
    model.joints[2].effects.pop_back();
    model.joints[1].effects.back() = chosen;
    outcome_.found.resize(1);
    Group group;
    group.candidate = {rival.effect, 1, rival.shape};
    refit(outcome_.models, logs_, test::no_whitening(), 4);
    outcome_.found[0].rival = Rival{group, Eigen::Map<const Eigen::VectorXd>(rival.linear.data(), 2), 5};
    outcome_.look_again(logs_);
    Gate gate = judge_again(outcome_, logs_, still_);
    outcome_.found[0].evidence.there = true;
    outcome_.found[0].evidence.against_rival = 1;  // 10 to 1
    Progress progress;
    settle_rivals(outcome_, gate, {nominal_, logs_, still_, SearchTask{}}, progress);
  }
  const EffectFit ripple_ = test::named_effect("ripple", {14}, {0.5, 0.2}),
                  spring_ = test::named_effect("spring", {}, {0.01, 0});
};

TEST_F(Rivals, TheOneThatErrsLessTakesThePlace) {
  settle(spring_, ripple_);
  ASSERT_EQ(outcome_.found.size(), 1U);
  EXPECT_NE(outcome_.models.current->joints[1].find("ripple"), nullptr);
  EXPECT_EQ(outcome_.models.current->joints[1].find("spring"), nullptr);
  EXPECT_TRUE(outcome_.found[0].evidence.there);
}

TEST_F(Rivals, TheOneThatErrsMoreDoesNot) {
  settle(ripple_, spring_);
  ASSERT_EQ(outcome_.found.size(), 1U);
  EXPECT_NE(outcome_.models.current->joints[1].find("ripple"), nullptr);
}

/// The same, of two train logs that judge one another.
class NamesWithoutValidation : public NamesAtTheGate {
 protected:
  NamesWithoutValidation() {
    logs_[1].fits = true;
    logs_[1].log.role = Role::train;
    outcome_.look_again(logs_);
  }
};

TEST_F(NamesWithoutValidation, StayWhereTheyLowerTheError) {
  EXPECT_TRUE(plain_error(nominal_, logs_).size() == 0);
  EXPECT_EQ(pass(outcome_, nominal_, logs_, still_).groups.size(), 1U);
}

TEST_F(NamesWithoutValidation, AnOutcomeThatLacksWhatIsThereErrsMore) {
  const Eigen::VectorXd with = judged_error(outcome_.models, logs_);
  take_out(outcome_, outcome_.found[0].id, logs_);  // the ripple
  const Eigen::VectorXd without = judged_error(outcome_.models, logs_);
  EXPECT_GT(without[1], 1.5 * with[1]);
  EXPECT_NEAR(without[0], with[0], 0.1 * with[0]);
}

TEST_F(NamesWithoutValidation, GoWhereTheyRaiseItMoreThanTheyMay) {
  outcome_.models.options.gate.worse = 0;  // no error is that low
  EXPECT_TRUE(pass(outcome_, nominal_, logs_, still_).groups.empty());
}

TEST_F(NamesWithoutValidation, GoWhereTheWholeModelNoLongerFitsTheTrainLogs) {
  EXPECT_FALSE(harmful_finding(outcome_, nominal_, outcome_.models.current, logs_));
  IdentifiedModel lost = outcome_.models.current;
  lost.joints[1].effects.back().linear = {-0.5, -0.2};
  const std::optional<EffectId> gone = harmful_finding(outcome_, nominal_, lost, logs_);
  ASSERT_TRUE(gone);
  EXPECT_EQ(gone->joint, 1U);
  // What validate logs bear out counts, whatever the train logs say.
  logs_[1].fits = false;
  EXPECT_EQ(harmed_joints(outcome_.models.options.gate, nominal_, outcome_.models.current, logs_),
            std::vector<bool>(6, false));
}

/// A PUMA 560 with a further torque of the second joint's motion, and names that it gets.
class NamesOfAnother : public NamesAtTheGate {
 protected:
  Gate judged(const std::function<double(double q, double ddq, double load)>& torque,
              const std::vector<EffectFit>& names) {
    for (std::size_t l = 0; l < logs_.size(); ++l) {
      logs_[l] = test::small_session_log(nominal_, l == 0 ? Role::train : Role::validate, l + 1);
      ProcessedLog& log = logs_[l].log;
      const MotionRows motion = log.joint_motion(1);
      for (Eigen::Index k = 0; k < log.samples(); ++k)
        log.tau(k, 1) += torque(motion.q(k, 0), motion.ddq(k, 0), log.tau(k, 1));
    }
    auto& joints = outcome_.models.current->joints;
    joints[2].effects.pop_back();
    joints[1].effects.pop_back();
    joints[1].effects.insert(joints[1].effects.end(), names.begin(), names.end());
    outcome_.look_again(logs_);
    return judge_again(outcome_, logs_, still_);
  }
};

TEST_F(NamesOfAnother, LeaveWhatIsPlainBesideTheNoise) {
  const auto torque = [](double q, double, double) { return 20 * std::cos(14 * q) + 0.15 * std::sin(9 * q); };
  const std::vector<EffectFit> names{test::named_effect("ripple", {14}, {20, 0})};
  const Gate gate = judged(torque, names);
  EXPECT_GT(gate.closure[1], 0.99);
  EXPECT_TRUE(gate.remains[1]);
  EXPECT_TRUE(gate.accepted[1]);
  EXPECT_TRUE(gate.believed[0]);
  outcome_.models.options.gate.beyond_noise = 1e6;
  EXPECT_FALSE(judge_again(outcome_, logs_, still_).remains[1]);
}

TEST_F(NamesOfAnother, AreNotBelievedForAStop) {
  const Gate gate =
      judged([](double q, double, double) { return -6 * std::max(q - 0.3, 0.0); },
             {test::named_effect("gravity_compensator", {}, {0.5, 0.5}), test::named_effect("spring", {}, {-1, 0})});
  ASSERT_EQ(gate.groups.size(), 2U);
  EXPECT_FALSE(gate.believed[0]);
  EXPECT_FALSE(gate.believed[1]);
  EXPECT_TRUE(gate.remains[1]);
  EXPECT_FALSE(gate.remains[2]);
}

TEST_F(NamesOfAnother, AreNotBelievedForASquareOfTheAcceleration) {
  const Gate gate = judged([](double, double ddq, double load) { return 0.06 * ddq * ddq + 0.02 * load; },
                           {test::named_effect("torque_gain", {}, {0.02})});
  ASSERT_EQ(gate.groups.size(), 1U);
  EXPECT_LT(gate.own[0].form, outcome_.models.options.gate.sure_closure);
  EXPECT_GT(gate.own[0].form, outcome_.models.options.gate.least_closure);
  EXPECT_FALSE(gate.believed[0]);
  EXPECT_TRUE(gate.remains[1]);
}

TEST_F(NamesOfAnother, AreMissedByACurveWhereNoiseHardlyLooksLikeIt) {
  Gate gate = judged([](double q, double, double) { return std::exp(-100 * (q - 0.2) * (q - 0.2)); }, {});
  outcome_.found.clear();
  gate.remains.assign(6, false);
  const auto curve_at = [&](double chance) {
    for (LackOfFit& lack : outcome_.lack) lack = {};
    outcome_.lack[1].state_p = chance;
    return curves_of_the_rest(outcome_, gate, still_, Curves(6), logs_)[1];
  };
  const LackOfFitOptions& options = outcome_.models.options.lack_of_fit;
  const std::optional<CurveResult> curve = curve_at(0.5 * options.curve);
  ASSERT_TRUE(curve);
  EXPECT_EQ(curve->effect, "position_curve");
  EXPECT_FALSE(curve_at(2 * options.curve));
}

TEST_F(NamesAtTheGate, AreWeighedAgainWithoutWhatIsSetAside) {
  Gate gate = judge_again(outcome_, logs_, still_);
  std::vector<Likely> likely;
  set_aside(outcome_, gate, nominal_, logs_, still_, likely);
  EXPECT_TRUE(likely.empty());  // a spring that is not there is not even that
  ASSERT_EQ(outcome_.found.size(), 1U);
  EXPECT_EQ(outcome_.models.current->joints[2].find("spring"), nullptr);
  EXPECT_EQ(outcome_.found[0].evidence.certainty, Certainty::established);
  EXPECT_EQ(gate.groups.size(), 1U);
}

TEST_F(NamesAtTheGate, ACoefficientIsNothingByItsTorque) {
  const Linearised& problem = *outcome_.problem;
  const Group& ripple = problem.groups()[in_model(problem)[0]];
  const double rated = outcome_.models.current->joints[1].rated_torque;
  EXPECT_TRUE(is_at_nothing(problem, ripple, test::named_effect("ripple", {14}, {5e-7 * rated, 0})));
  EXPECT_FALSE(is_at_nothing(problem, ripple, test::named_effect("ripple", {14}, {5e-6 * rated, 0})));
  // Of a soft gear a compliance of 1e-5 rad / (N*m) bends, whatever the rated torque.
  Models models = outcome_.models;
  models.current->joints[1].effects.back() = test::named_effect("elasticity", {0}, {1e-5});
  const Linearised bent(models, logs_, test::no_whitening());
  const Group& elasticity = bent.groups()[in_model(bent)[0]];
  EXPECT_FALSE(is_at_nothing(bent, elasticity, models.current->joints[1].effects.back()));
}

TEST_F(NamesAtTheGate, ATorqueWithoutAListedNameLeavesItsJointUnexplained) {
  const Gate gate = pass(outcome_, nominal_, logs_, still_);
  weigh_evidence(outcome_, gate);
  ASSERT_EQ(outcome_.found.size(), 1U);
  const auto verdict_with = [&](Certainty certainty) {
    outcome_.found[0].evidence.certainty = certainty;
    return result(gate).joints[1];
  };
  EXPECT_EQ(verdict_with(Certainty::likely).verdict, Verdict::explained);
  const JointDiagnosis nameless = verdict_with(Certainty::unlisted);
  EXPECT_EQ(nameless.verdict, Verdict::unexplained);
  EXPECT_TRUE(nameless.effects.empty());
  EXPECT_TRUE(nameless.left);
}

/// A large ripple and, beside it at the same joint, one with half a percent of its power.
class ASmallNameBesideALargeOne : public testing::Test {
 protected:
  ASmallNameBesideALargeOne() : nominal_(test::fitted_puma()) {
    IdentifiedModel robot = nominal_;
    outcome_.models = test::around(nominal_);
    auto& effects = outcome_.models.current->joints[1].effects;
    for (const auto& [wavenumber, amplitude] : {std::pair{14.0, 1.0}, std::pair{23.0, 0.07}}) {
      robot.joints[1].effects.push_back(test::effect("ripple", {wavenumber}, {amplitude, 0}));
      effects.push_back(test::named_effect("ripple", {wavenumber}, {amplitude, 0}));
      outcome_.found.push_back({{false, 1, effects.size() - 1}, 100, {}});
    }
    for (const auto& [role, seed] : {std::pair{Role::train, 1}, std::pair{Role::validate, 2}})
      logs_.push_back(test::small_session_log(robot, role, static_cast<std::uint64_t>(seed)));
    outcome_.whitening = test::no_whitening();
    outcome_.not_identifiable.resize(7);
    outcome_.look_again(logs_);
  }
  Gate judged() { return pass(outcome_, nominal_, logs_, std::vector<bool>(6, false)); }

  IdentifiedModel nominal_;
  std::vector<SessionLog> logs_;
  Outcome outcome_;
};

TEST_F(ASmallNameBesideALargeOne, GoesWhereItBringsTooLittleAndNotBefore) {
  const Gate gate = judged();
  ASSERT_EQ(gate.groups.size(), 2U);
  const double small = std::min(gate.held.alone[0].sum(), gate.held.alone[1].sum());
  EXPECT_GT(small, outcome_.models.options.gate.least_gain);
  outcome_.models.options.gate.least_gain = 2 * small;
  EXPECT_EQ(judged().groups.size(), 1U);
}

TEST(WhatJudges, IsNamed) {
  ProcessedLog train, validate;
  validate.role = Role::validate;
  EXPECT_EQ(gate_of({train, validate}), "validate logs");
  EXPECT_EQ(gate_of({train, train}), "train logs, whole or in parts, each judged by coefficients fitted to the others");
  EXPECT_EQ(gate_of({train}), "blocks of the train log, each judged by coefficients fitted to the others");
}

}  // namespace
}  // namespace fxdyn::diagnosis
