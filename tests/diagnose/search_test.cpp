// The search on one log of a PUMA 560: what it finds, and that noise alone is nothing.

#include "host_tools/diagnose/search.hpp"

#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_tools/diagnose/ripples.hpp"
#include "tests/diagnose/small_problem.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

class SearchOfEffects : public testing::Test {
 protected:
  SearchOfEffects() : model_(test::fitted_puma()) {}

  /// Searches logs of a robot with `more` at a joint; candidates: the shapes that are given, and ripples.
  Choice run(std::size_t joint, const std::vector<EffectFit>& more, const std::vector<EffectCandidate>& candidates) {
    IdentifiedModel robot = model_;
    for (const EffectFit& fit : more) robot.joints[joint].effects.push_back(fit);
    return run(robot, candidates);
  }
  Choice run(const IdentifiedModel& robot, const std::vector<EffectCandidate>& candidates) {
    logs_ = {test::small_session_log(robot, Role::train, 1), test::small_session_log(robot, Role::train, 2)};
    Models models = test::around(model_);
    models.options = options_;
    if (baseline_) {
      logs_.push_back(test::small_session_log(model_, Role::baseline, 3));
      models.healthy = model_;
      models.has_baseline = true;
    }
    problem_ = std::make_unique<Linearised>(models, logs_, test::no_whitening());
    std::vector<Group> groups;
    for (const EffectCandidate& candidate : candidates) {
      Group group;
      group.candidate = candidate;
      group.on_body = find_effect(candidate.effect)->acts_on == ActsOn::body;
      group.nonlinear = 1;
      for (const ParameterInfo& p : find_effect(candidate.effect)->linear) group.lower.push_back(p.lower);
      groups.push_back(group);
    }
    problem_->add_all(groups);
    Search search(*problem_, task_);
    Choice choice = search.unite(search.run({}, progress_));
    not_absorbed_ = search.not_absorbed();
    if (!choice.groups.empty()) found_ = search.explain(choice);
    return choice;
  }
  const EffectCandidate& candidate(const Choice& choice, std::size_t i) const {
    return problem_->groups()[choice.groups[i]].candidate;
  }

  /// What was found, as `ripple 14 at joint 2`.
  std::string names(const Choice& choice) const {
    std::string out;
    for (std::size_t i = 0; i < choice.groups.size(); ++i) {
      const EffectCandidate& one = candidate(choice, i);
      out += fmt::format("{} {} at joint {}; ", one.effect, fmt::join(one.shape, ","), one.joint + 1);
    }
    return out;
  }

  IdentifiedModel model_;
  Options options_;
  SearchTask task_;
  bool baseline_ = false;
  std::vector<SessionLog> logs_;
  std::unique_ptr<Linearised> problem_;
  std::vector<Found> found_;
  std::vector<double> not_absorbed_;
  Progress progress_;
};

const std::vector<EffectCandidate> stribeck_grid{{"stribeck", 1, {0.05}},
                                                 {"stribeck", 1, {0.1}},
                                                 {"stribeck", 1, {0.4}},
                                                 {"stribeck", 2, {0.1}},
                                                 {"viscous_cubic", 1, {}}};

TEST_F(SearchOfEffects, FindsNothingInNoise) { EXPECT_EQ(names(run(0, {}, stribeck_grid)), ""); }

TEST_F(SearchOfEffects, FindsNothingBelowItsThresholds) {
  options_.search.least_score = options_.search.most_score = 1e6;
  EXPECT_EQ(names(run(1, {test::effect("ripple", {14}, {0.3, 0.2})}, stribeck_grid)), "");
}

TEST_F(SearchOfEffects, FindsARippleWithItsWavenumber) {
  const Choice choice = run(1, {test::effect("ripple", {14}, {0.3, 0.2})}, stribeck_grid);
  ASSERT_EQ(choice.groups.size(), 1U) << names(choice);
  EXPECT_EQ(candidate(choice, 0).effect, "ripple");
  EXPECT_EQ(candidate(choice, 0).joint, 1U);
  EXPECT_NEAR(candidate(choice, 0).shape[0], 14, 0.2);
  const Index first = first_of_groups(*problem_, choice);
  EXPECT_NEAR(choice.fit.x[first], 0.3, 0.05);
  EXPECT_NEAR(choice.fit.x[first + 1], 0.2, 0.05);
}

TEST_F(SearchOfEffects, TheSpectrumOverTheAngleHasTheStrongerRippleFirst) {
  run(1, {test::effect("ripple", {14}, {0.3, 0.2}), test::effect("ripple", {25}, {0.1, 0.1})}, {});
  const LinearFit nuisance = problem_->solver().solve(problem_->nuisance());
  const std::vector<Group> peaks = ripples(*problem_, 1, problem_->solver().residual(1, nuisance), 1);
  ASSERT_EQ(peaks.size(), 1U);
  EXPECT_NEAR(peaks[0].candidate.shape[0], 14, 0.5);
  EXPECT_EQ(peaks[0].candidate.joint, 1U);
}

/// How many periods of a wave joint 2 passes at once where the filter lets it through.
double periods_in_a_row(const ProcessedLog& log, const Motion& motion, double n) {
  double most = 0, from = 0, to = 0;
  for (Index k = log.first; k < log.last; ++k) {
    const bool fast = n * std::fabs(motion.dq(k, 1)) > 2 * std::numbers::pi * log.filter.torque_cutoff_hz;
    from = fast || k == log.first ? motion.q(k, 1) : std::min(from, motion.q(k, 1));
    to = fast || k == log.first ? motion.q(k, 1) : std::max(to, motion.q(k, 1));
    most = std::max(most, (to - from) * n / (2 * std::numbers::pi));
  }
  return most;
}

TEST_F(SearchOfEffects, NoWaveIsTriedOfWhichTheFilterLetsNoTwoPeriodsThrough) {
  run(1, {}, {});
  const LinearFit nuisance = problem_->solver().solve(problem_->nuisance());
  const std::vector<Group> peaks = ripples(*problem_, 1, problem_->solver().residual(1, nuisance), 10000);
  double shortest = 0;
  for (const Group& peak : peaks) shortest = std::max(shortest, peak.candidate.shape[0]);
  const auto periods = [&](double n) {
    return std::max(periods_in_a_row(problem_->logs()[0].log, problem_->motion(0), n),
                    periods_in_a_row(problem_->logs()[1].log, problem_->motion(1), n));
  };
  EXPECT_GE(periods(shortest), 1.8);  // the spectrum reads every few samples
  EXPECT_LT(periods(1.2 * shortest), 2);
}

TEST_F(SearchOfEffects, RefinesAShapeBetweenThoseOfTheGrid) {
  const Choice choice = run(1, {test::effect("stribeck", {0.2}, {1.5})}, stribeck_grid);
  ASSERT_EQ(choice.groups.size(), 1U) << names(choice);
  EXPECT_EQ(candidate(choice, 0).effect, "stribeck");
  EXPECT_NEAR(candidate(choice, 0).shape[0], 0.2, 0.05);
  ASSERT_EQ(found_.size(), 1U);
  EXPECT_GT(found_[0].score, 25);
}

TEST_F(SearchOfEffects, OneLawTakesThePlaceOfThoseThatItUnites) {
  const std::vector<EffectCandidate> parts{
      {"presliding", 1, {0.005}}, {"presliding", 1, {0.015}}, {"stribeck", 1, {0.1}}, {"stribeck", 1, {0.3}}};
  const Choice choice = run(1, {test::effect("lugre", {0.014, 0.2, 0.7}, {6, 30})}, parts);
  ASSERT_EQ(names(choice).substr(0, 6), "lugre ") << names(choice);
  EXPECT_EQ(choice.groups.size(), 1U) << names(choice);
  // The search begins at the shapes of the parts; refit() brings them to the least squares'.
  EXPECT_GT(choice.score, problem_->groups().empty() ? 0 : Search(*problem_, {}).evaluate({}).score + 25);
}

TEST_F(SearchOfEffects, ALawThatIsNotToBeTriedLeavesThePlaceToItsParts) {
  task_.never = {{"lugre", 1, {}}};
  const Choice choice = run(1, {test::effect("lugre", {0.014, 0.2, 0.7}, {6, 30})},
                            {{"presliding", 1, {0.005}}, {"presliding", 1, {0.015}}, {"stribeck", 1, {0.1}}});
  EXPECT_EQ(names(choice).find("lugre"), std::string::npos) << names(choice);
  EXPECT_NE(names(choice).find("presliding"), std::string::npos) << names(choice);
}

TEST_F(SearchOfEffects, OneOfTheUnitedStaysWhereTheOtherDoesNotShow) {
  const Choice choice = run(1, {test::effect("stribeck", {0.2}, {1.5})}, stribeck_grid);
  ASSERT_EQ(choice.groups.size(), 1U) << names(choice);
  EXPECT_EQ(candidate(choice, 0).effect, "stribeck");
}

TEST_F(SearchOfEffects, ALawThatExplainsNoMoreThanItsPartsIsThose) {
  const Choice choice = run(1, {test::effect("presliding", {0.01}, {4}), test::effect("stribeck", {0.2}, {2})},
                            {{"lugre", 1, {0.01, 0.2, 0.7}}});
  ASSERT_EQ(choice.groups.size(), 2U) << names(choice);
  EXPECT_EQ(candidate(choice, 0).effect, "presliding") << names(choice);
  EXPECT_EQ(candidate(choice, 1).effect, "stribeck") << names(choice);
}

TEST_F(SearchOfEffects, ALawIsNotDividedIntoMoreEffectsThanAJointMayHave) {
  task_.settings.max_effects = 1;
  const Choice choice = run(1, {test::effect("presliding", {0.01}, {4}), test::effect("stribeck", {0.2}, {2})},
                            {{"lugre", 1, {0.01, 0.2, 0.7}}});
  ASSERT_EQ(choice.groups.size(), 1U) << names(choice);
  EXPECT_EQ(candidate(choice, 0).effect, "lugre") << names(choice);
}

TEST_F(SearchOfEffects, ManyContactsAreNotOne) {
  const std::vector<EffectCandidate> parts{{"presliding", 1, {0.005}}, {"presliding", 1, {0.02}}};
  const Choice choice = run(1, {test::effect("maxwell_slip", {0.04}, {2, 1, 1, 0.5, 3})}, parts);
  EXPECT_EQ(names(choice).substr(0, 13), "maxwell_slip ") << names(choice);
  EXPECT_EQ(choice.groups.size(), 1U) << names(choice);
}

// Gains of the joints that feel a load do some of its work, and each scores as an effect of its joint alone does.
TEST_F(SearchOfEffects, GivesOneLoadForSeveralGains) {
  IdentifiedModel robot = model_;
  robot.body.push_back(test::effect("payload", {}, {1, 0.02, -0.01, 0.03}));
  std::vector<EffectCandidate> candidates{{"payload", 0, {}}};
  for (std::size_t joint = 0; joint < 6; ++joint) {
    for (const char* effect : {"torque_gain", "gravity_compensator", "spring", "load_friction"})
      candidates.push_back({effect, joint, {}});
  }
  baseline_ = true;
  const Choice choice = run(robot, candidates);
  EXPECT_EQ(names(choice), "payload  at joint 1; ");
}

// Its column has how the gear bends under it, those of the base parameters do not: so it could be told from them.
TEST_F(SearchOfEffects, ALoadOfABendingArmIsTheLastLinksWithoutAHealthySession) {
  model_.joints[1].effects.push_back(test::effect("elasticity", {0.01}, {2e-4}));
  IdentifiedModel loaded = model_;
  loaded.body.push_back(test::effect("payload", {}, {2, 0.1, 0, 0.1}));
  EXPECT_EQ(names(run(loaded, {{"payload", 0, {}}})).find("payload"), std::string::npos);
  EXPECT_EQ(not_absorbed_[0], 0);
  baseline_ = true;
  EXPECT_NE(names(run(loaded, {{"payload", 0, {}}})).find("payload"), std::string::npos);
  EXPECT_GT(not_absorbed_[0], 0.1);
}

TEST_F(SearchOfEffects, NeedsLongerSetsToBringMore) {
  const Choice choice =
      run(1, {test::effect("ripple", {14}, {0.3, 0.2}), test::effect("stribeck", {0.1}, {1.5})}, stribeck_grid);
  EXPECT_EQ(choice.groups.size(), 2U) << names(choice);
}

}  // namespace
}  // namespace fxdyn::diagnosis
