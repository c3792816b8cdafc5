// How sure a name is, and what a joint's verdict follows from.

#include "host_tools/diagnose/certainty.hpp"

#include <gtest/gtest.h>

#include "host_tools/diagnose/explore.hpp"
#include "host_tools/diagnose/verdict.hpp"

namespace fxdyn::diagnosis {
namespace {

/// Evidence of an effect whose form holds as a curve of its own does.
Evidence judged(double nothing, std::optional<double> rival, double deviations, bool holds = true, double form = 1) {
  Evidence out;
  out.against_nothing = nothing;
  out.against_rival = rival;
  out.deviations = deviations;
  judge(out, holds, form, {});
  return out;
}

TEST(Certainty, EstablishedAgainstNothingAndAgainstTheRival) {
  EXPECT_EQ(judged(3, 3, 4).certainty, Certainty::established);
  EXPECT_EQ(judged(3, {}, 4).certainty, Certainty::established);
  EXPECT_EQ(judged(2.9, 3, 4).certainty, Certainty::likely);
  EXPECT_EQ(judged(3, 2.9, 4).certainty, Certainty::likely);
  EXPECT_EQ(judged(3, 3, 3.9).certainty, Certainty::likely);
}

TEST(Certainty, LikelyFromTwentyToOne) {
  EXPECT_EQ(judged(1.3, 1.3, 2).certainty, Certainty::likely);
  EXPECT_EQ(judged(1.2, 1.3, 2).certainty, Certainty::unlisted);
  EXPECT_EQ(judged(1.3, 1.2, 2).certainty, Certainty::unlisted);
}

TEST(Certainty, AFormThatAFreeCurveBeatsIsNotEstablished) {
  EXPECT_EQ(judged(40, {}, 20, false, 0.6).certainty, Certainty::likely);
  EXPECT_EQ(judged(40, {}, 20, false, 0.4).certainty, Certainty::unlisted);
}

TEST(Certainty, WhatIsThereForSureStaysWhateverItsName) {
  const Evidence either = judged(40, 0.2, 20), other_form = judged(40, {}, 20, false, 0.4), weak = judged(2, 0.2, 20);
  EXPECT_TRUE(either.there);
  EXPECT_TRUE(either.undecided);
  EXPECT_EQ(either.certainty, Certainty::unlisted);
  EXPECT_TRUE(other_form.there);
  EXPECT_FALSE(other_form.undecided);
  EXPECT_FALSE(weak.there);
  EXPECT_FALSE(weak.undecided);
  EXPECT_FALSE(judged(40, 5, 20).undecided);
}

/// A joint at which a name closes 40 noise variances, and its certainty then.
class NameBesideMore : public testing::Test {
 protected:
  NameBesideMore() {
    outcome_.lack.resize(1);
    outcome_.lack[0].state_p = 1e-20;
    gate_.held.before = Eigen::VectorXd::Constant(1, 240);
    gate_.held.after = Eigen::VectorXd::Constant(1, 200);
    gate_.held.excess = Eigen::VectorXd::Constant(1, 0);
    gate_.gap = Eigen::VectorXd::Constant(1, 40);
    gate_.of_law = {false};
  }
  static Finding finding(Certainty certainty, double share) {
    Finding out{{false, 0, 0}, 100, {}};
    out.evidence.certainty = certainty;
    out.evidence.gain = 40 * share;
    return out;
  }
  Certainty certainty(Certainty before = Certainty::established, double closure = 1) {
    outcome_.found = {finding(before, closure)};
    doubt_beside_more(outcome_, gate_, curves_, likely_);
    return outcome_.found[0].evidence.certainty;
  }
  /// Whether a likely name that was taken out of the model stays listed.
  bool stays_likely(double closure) {
    likely_ = {{finding(Certainty::likely, closure), {}, {}}};
    doubt_beside_more(outcome_, gate_, curves_, likely_);
    return !likely_.empty();
  }

  Outcome outcome_;
  Gate gate_;
  Curves curves_ = Curves(1);
  std::vector<Likely> likely_;
};

TEST_F(NameBesideMore, IsLikelyAtMost) {
  EXPECT_EQ(certainty(), Certainty::established);
  gate_.held.excess[0] = 39;
  EXPECT_EQ(certainty(), Certainty::established);
  gate_.held.excess[0] = 41;
  EXPECT_EQ(certainty(), Certainty::likely);
}

TEST_F(NameBesideMore, IsEstablishedWhereTheRestIsNoiseOrTheErrorOfALaw) {
  gate_.held.excess[0] = 60;
  gate_.of_law = {true};
  EXPECT_EQ(certainty(), Certainty::established);
  gate_.of_law = {false};
  outcome_.lack[0].state_p = 0.1;
  EXPECT_EQ(certainty(), Certainty::established);
}

TEST_F(NameBesideMore, CountsWhatWandersThoughItWasTakenOff) {
  outcome_.lack[0].state_p = 0.1;
  curves_[0].emplace();
  curves_[0]->signal = "t";
  curves_[0]->closes = 0.16;  // of 200 / (1 - 0.16): 38
  EXPECT_EQ(certainty(), Certainty::established);
  curves_[0]->closes = 0.18;  // 44
  EXPECT_EQ(certainty(), Certainty::likely);
}

TEST_F(NameBesideMore, CountsWhatACurveOfTheMotionCloses) {
  outcome_.lack[0].state_p = 0.1;
  curves_[0].emplace();
  curves_[0]->signal = "q";
  curves_[0]->closes = 0.18;  // of 200: 36
  EXPECT_EQ(certainty(), Certainty::established);
  curves_[0]->closes = 0.22;
  EXPECT_EQ(certainty(), Certainty::likely);
}

TEST_F(NameBesideMore, IsLikelyOnlyAsTheLargerPart) {
  EXPECT_EQ(certainty(Certainty::established, 0.1), Certainty::established);
  EXPECT_EQ(certainty(Certainty::likely, 0.6), Certainty::likely);
  EXPECT_EQ(certainty(Certainty::likely, 0.4), Certainty::unlisted);
  EXPECT_TRUE(stays_likely(0.6));
  EXPECT_FALSE(stays_likely(0.4));
  gate_.held.excess[0] = 20;  // 60 are there
  gate_.gap[0] = 60;
  EXPECT_FALSE(stays_likely(0.6));
  EXPECT_TRUE(stays_likely(0.8));
  curves_[0].emplace();
  curves_[0]->signal = "t";
  curves_[0]->closes = 0.16;  // 38 more, which the gap has lost
  EXPECT_FALSE(stays_likely(0.8));
  EXPECT_TRUE(stays_likely(1.3));
}

TEST(LeftOver, IsTheExcessWithAnIntervalFromItsStretches) {
  // Of 10 stretches of 100 rows with noise of variance 1: 300 of power above it before, 60 after.
  HeldOut held;
  held.after = Eigen::VectorXd::Constant(1, 1060);
  held.excess = Eigen::VectorXd::Constant(1, 60);
  held.stretches = {std::vector<Stretch>(10, Stretch{130, 106, 100})};
  const Share even = left_of(held, 300, 0);
  EXPECT_DOUBLE_EQ(even.share, 0.2);
  EXPECT_NEAR(even.low, 0.2, 1e-9);  // alike everywhere
  EXPECT_NEAR(even.high, 0.2, 1e-9);
  // The same sums, what is left in half of the stretches.
  for (std::size_t s = 0; s < 10; ++s) held.stretches[0][s].after = s < 5 ? 112 : 100;
  const Share uneven = left_of(held, 300, 0);
  EXPECT_DOUBLE_EQ(uneven.share, 0.2);
  // left 12 and 0 of gaps of 30: deviations of 6 each
  EXPECT_NEAR(uneven.high - uneven.share, 1.96 * std::sqrt(10 * 36.0) / 300, 1e-9);
  EXPECT_NEAR(uneven.share - uneven.low, uneven.high - uneven.share, 1e-9);
  EXPECT_EQ(left_of(held, 0, 0).share, 0);
}

TEST(VerdictOfAJoint, IsWhatIsThereAndWhatIsLeft) {
  JointState state;
  EXPECT_EQ(verdict_of(state), Verdict::nothing_missing);
  state.structured = true;
  EXPECT_EQ(verdict_of(state), Verdict::unexplained);
  state.established = true;  // and too little remains on the data that judge
  EXPECT_EQ(verdict_of(state), Verdict::explained);
  state.remains = true;
  EXPECT_EQ(verdict_of(state), Verdict::partly_explained);
  state.structured = false;  // a free curve beats its names
  EXPECT_EQ(verdict_of(state), Verdict::partly_explained);
  state.established = false;
  EXPECT_EQ(verdict_of(state), Verdict::unexplained);
}

TEST(VerdictOfAJoint, ATorqueThatGotNoNameIsUnexplained) {
  JointState state;
  state.nameless = true;
  EXPECT_EQ(verdict_of(state), Verdict::unexplained);
  state.established = true;  // beside a name it is not told
  EXPECT_EQ(verdict_of(state), Verdict::explained);
}

TEST(VerdictOfAJoint, AnEffectOnTheRobotExplainsIt) {
  JointState state;
  state.reached = true;
  EXPECT_EQ(verdict_of(state), Verdict::explained);
}

TEST(VerdictOfAJoint, ADeflectionWithoutANameIsLeft) {
  JointState state;
  state.bends = true;
  EXPECT_EQ(verdict_of(state), Verdict::unexplained);
  state.there = true;
  EXPECT_EQ(verdict_of(state), Verdict::partly_explained);
}

TEST(VerdictOfARobot, IsTheWorst) {
  EXPECT_EQ(worst({}), Verdict::nothing_missing);
  EXPECT_EQ(worst({Verdict::nothing_missing, Verdict::not_excited}), Verdict::not_excited);
  EXPECT_EQ(worst({Verdict::not_excited, Verdict::explained}), Verdict::explained);
  EXPECT_EQ(worst({Verdict::explained, Verdict::partly_explained}), Verdict::partly_explained);
  EXPECT_EQ(worst({Verdict::partly_explained, Verdict::unexplained}), Verdict::unexplained);
}

}  // namespace
}  // namespace fxdyn::diagnosis
