// Where a gap sits: regions of the motion that hold more of its power than of the samples.

#include "host_tools/diagnose/where.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "host_tools/effects/identified_model.hpp"
#include "tests/diagnose/small_log.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr std::size_t joint = 1;

class Where : public testing::Test {
 protected:
  IdentifiedModel model_ = test::plant_of(read_urdf(test::puma560));
  ProcessedLog log_ = test::small_log(model_, Role::train, 1);

  /// Regions of an error of 1 N*m wherever `inside` holds, of a tenth of that elsewhere.
  template <class Inside>
  std::vector<GapRegion> regions(Inside inside) {
    return place(inside).regions;
  }
  template <class Inside>
  GapPlace place(Inside inside) {
    const MotionRows motion = log_.joint_motion(static_cast<Index>(joint));
    VectorXd error(log_.samples());
    for (Index k = 0; k < error.size(); ++k) error[k] = inside(motion.q(k, 0), motion.dq(k, 0), log_.t[k]) ? 1 : 0.1;
    const VectorXd load = predict(model_, log_).col(static_cast<Index>(joint));
    return where(model_.robot, joint, {&log_}, {load}, {error}, 0.1, {});
  }
  static GapRegion region(const std::vector<GapRegion>& all, const std::string& signal) {
    const auto found = std::find_if(all.begin(), all.end(), [&](const GapRegion& r) { return r.signal == signal; });
    if (found == all.end()) throw std::runtime_error("no region of " + signal);
    return *found;
  }
};

TEST_F(Where, FindsTheRangeOfThePosition) {
  const auto all = regions([](double q, double, double) { return q > 0.2 && q < 0.4; });
  ASSERT_EQ(all.at(0).signal, "q");
  const double bin = 1.6 / 24;  // of the joint's range
  EXPECT_NEAR(all[0].from, 0.2, bin);
  EXPECT_NEAR(all[0].to, 0.4, bin);
  EXPECT_GT(*all[0].share_of_gap, 0.95);
}

TEST_F(Where, FindsTheSpeed) {
  const auto all = regions([](double, double dq, double) { return dq > 0.9; });
  const GapRegion found = region(all, "dq");
  EXPECT_NEAR(found.from, 0.9, 0.15);
  EXPECT_GT(*found.share_of_gap, 0.95);
}

TEST_F(Where, FindsTheTime) {
  const auto all = regions([](double, double, double t) { return t > 5 && t < 7; });
  const GapRegion found = region(all, "t");
  EXPECT_NEAR(found.from, 5, 1);
  EXPECT_NEAR(found.to, 7, 1);
  EXPECT_GT(*found.share_of_gap, 0.95);
}

TEST_F(Where, FindsTheDirection) {
  const GapRegion found = region(regions([](double, double dq, double) { return dq < 0; }), "direction");
  EXPECT_EQ(found.from, -1);
  EXPECT_EQ(found.to, 0);
  EXPECT_GT(*found.share_of_gap, 0.95);
}

TEST_F(Where, SaysSoWhereTheGapIsTheSameEverywhere) {
  const GapPlace found = place([](double, double, double) { return true; });
  EXPECT_TRUE(found.regions.empty());
  EXPECT_EQ(found.sentence, "");
}

TEST_F(Where, AnErrorThatHasNothingToDoWithTheMotionHasNoPlaceInIt) {
  const auto all = regions([](double, double, double t) { return std::fmod(t, 0.37) < 0.1; });
  for (const char* signal : {"q", "dq", "ddq", "load", "direction"}) {
    for (const GapRegion& region : all) EXPECT_NE(region.signal, signal);
  }
}

TEST_F(Where, TheSentenceHasTheClearestRegion) {
  EXPECT_THAT(
      place([](double q, double, double) { return q > 0.2 && q < 0.4; }).sentence,
      testing::MatchesRegex("[19].* % of the gap is between 0\\.[12].* and 0\\.[34].* rad, in .* % of the time"));
}

TEST_F(Where, SlowMotionIsAtReversals) {
  const GapPlace found = place([](double, double dq, double) { return std::fabs(dq) < 0.2; });
  const GapRegion slow = found.regions.at(0);
  EXPECT_TRUE(slow.signal == "speed" || slow.signal == "dq");
  EXPECT_LT(slow.from, 0.02);
  EXPECT_NEAR(slow.to, 0.2, 0.06);
  EXPECT_THAT(found.sentence, testing::HasSubstr("at reversals, below 0."));
}

TEST_F(Where, AnotherJointsPositionIsNamedWithIt) {
  constexpr std::size_t other = 3;
  VectorXd error(log_.samples());
  for (Index k = 0; k < error.size(); ++k) error[k] = log_.q(k, other) > 0.5 ? 1 : 0.1;
  const VectorXd load = predict(model_, log_).col(static_cast<Index>(joint));
  const GapPlace found = where(model_.robot, joint, {&log_}, {load}, {error}, 0.1, {});
  ASSERT_FALSE(found.regions.empty());
  EXPECT_EQ(found.regions[0].signal, "q");
  EXPECT_EQ(found.regions[0].joint, other + 1);
  EXPECT_NEAR(found.regions[0].from, 0.5, 0.1);
  EXPECT_THAT(found.sentence, testing::HasSubstr("while joint 4 is between 0."));
}

TEST_F(Where, TheFirstSecondsAreCalledSo) {
  EXPECT_THAT(place([](double, double, double t) { return t < 3; }).sentence, testing::HasSubstr("in the first "));
  EXPECT_THAT(place([](double, double, double t) { return t > 17; }).sentence, testing::HasSubstr("in the last "));
}

// The load itself, but at another time.
TEST_F(Where, AGapAsSlowAsTheMotionIsAtNoFrequency) {
  const VectorXd load = predict(model_, log_).col(static_cast<Index>(joint));
  VectorXd error(load.size());
  const Index half = load.size() / 2;
  error << load.tail(load.size() - half), load.head(half);
  const GapPlace found = where(model_.robot, joint, {&log_}, {load}, {log_.filter_columns(error)}, 0, {});
  EXPECT_TRUE(found.regions.empty()) << found.sentence;
}

TEST_F(Where, AVibrationIsAtItsFrequency) {
  const VectorXd load = predict(model_, log_).col(static_cast<Index>(joint));
  VectorXd error(log_.samples());
  for (Index k = 0; k < error.size(); ++k) error[k] = std::sin(2 * std::numbers::pi * 6 * log_.t[k]);
  const GapPlace found = where(model_.robot, joint, {&log_}, {load}, {error}, 0, {});
  ASSERT_EQ(found.regions.size(), 1U);
  EXPECT_EQ(found.regions[0].signal, "frequency");
  EXPECT_EQ(found.regions[0].from, 4);
  EXPECT_EQ(found.regions[0].to, 8);
  EXPECT_GT(*found.regions[0].share_of_gap, 0.95);
}

TEST_F(Where, WithoutAClearRegionACurveSaysThePlace) {
  const VectorXd load = predict(model_, log_).col(static_cast<Index>(joint));
  const MotionRows motion = log_.joint_motion(static_cast<Index>(joint));
  VectorXd error = VectorXd::Constant(log_.samples(), 0.1);
  GapRegion of_curve;
  of_curve.signal = "q";
  of_curve.from = 1e3;
  of_curve.to = -1e3;
  for (Index k = 0; k < error.size(); ++k) {
    if (log_.t[k] < 5 || log_.t[k] > 5.5) continue;
    error[k] = 1;
    of_curve.from = std::min(of_curve.from, motion.q(k, 0));
    of_curve.to = std::max(of_curve.to, motion.q(k, 0));
  }
  const auto region = [&](const std::optional<GapRegion>& curve) {
    return where(model_.robot, joint, {&log_}, {load}, {error}, 0.1, {}, curve).regions.at(0);
  };
  EXPECT_EQ(region({}).signal, "t");
  EXPECT_EQ(region(of_curve).signal, "q");
  EXPECT_EQ(region(of_curve).from, of_curve.from);
  EXPECT_GT(*region(of_curve).share_of_gap, 0.95);
  of_curve.from = log_.q.col(joint).minCoeff();
  of_curve.to = log_.q.col(joint).maxCoeff();
  EXPECT_EQ(region(of_curve).signal, "t");  // everywhere is no place
}

// Slow noise has louder and quieter seconds, too.
TEST_F(Where, SlowNoiseSeldomHasAPlace) {
  Random random(9);
  const VectorXd load = predict(model_, log_).col(static_cast<Index>(joint));
  int placed = 0;
  constexpr int draws = 60;
  for (int draw = 0; draw < draws; ++draw) {
    VectorXd error(log_.samples());
    double slow = 0;
    for (double& value : error) value = slow = 0.99 * slow + 0.1 * random.normal();  // 0.4 s
    for (const GapRegion& region : where(model_.robot, joint, {&log_}, {load}, {error}, 0.1, {}).regions)
      if (region.signal != "frequency") {
        ++placed;
        break;
      }
  }
  // 2 % in the motion and 2 % in time are allowed: 7 of 60 have a chance of 0.6 %.
  EXPECT_LE(placed, 6);
}

}  // namespace
}  // namespace fxdyn::diagnosis
