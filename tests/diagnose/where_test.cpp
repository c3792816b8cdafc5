// Where a gap sits: regions of the motion that hold more of its power than of the samples.

#include "host_tools/diagnose/where.hpp"

#include <gtest/gtest.h>

#include <cmath>

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
    return where(model_.robot.joints[joint], joint, {&log_}, {load}, {error}, 0.1, {});
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
  EXPECT_EQ(found.sentence, "the gap is the same everywhere in these logs");
}

TEST_F(Where, AnErrorThatHasNothingToDoWithTheMotionHasNoPlaceInIt) {
  const auto all = regions([](double, double, double t) { return std::fmod(t, 0.37) < 0.1; });
  for (const char* signal : {"q", "dq", "ddq", "load", "direction"}) {
    for (const GapRegion& region : all) EXPECT_NE(region.signal, signal);
  }
}

TEST_F(Where, TheSentenceHasTheClearestRegion) {
  EXPECT_TRUE(place([](double q, double, double) {
                return q > 0.2 && q < 0.4;
              }).sentence.find("% of the gap is at position 0.") != std::string::npos);
}

}  // namespace
}  // namespace fxdyn::diagnosis
