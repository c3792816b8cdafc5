// What repeats or wanders in a residual, and the chance that noise looks like it.

#include "host_tools/diagnose/time_structure.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "host_tools/support/random.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// A healthy log and one of today, 40 s each at 50 rows a second, torque up to 20 Hz.
class StructureInTime : public testing::Test {
 protected:
  static constexpr Index rows = 2000;

  StructureInTime() : logs_(2) {
    for (SessionLog& entry : logs_) {
      entry.log.step_s = 0.02;
      entry.log.last = rows;
      entry.log.filter.torque_cutoff_hz = 20;
    }
    logs_[0].healthy = true;
    blocks_.all = blocks_.of_log = {{0, 0, rows, true, true}, {1, rows, rows, false, true}};
    Random random(3);
    for (double& value : noise_) value = random.normal();
  }
  /// In today's rows.
  template <class F>
  VectorXd with(F f) const {
    VectorXd out = noise_;
    for (Index k = 0; k < rows; ++k) out[rows + k] += f(0.02 * static_cast<double>(k));
    return out;
  }

  std::vector<SessionLog> logs_;
  Blocks blocks_;
  VectorXd noise_ = VectorXd(2 * rows);
};

TEST_F(StructureInTime, IsNoneInNoise) {
  EXPECT_GT(spectral_lines(logs_, blocks_, noise_, {1}, {}).p, 1e-3);
  EXPECT_GT(slow_changes(logs_, blocks_, noise_, {1}, {}).p, 1e-3);
}

TEST_F(StructureInTime, ALineIsFoundWithItsShare) {
  const TimeStructure found =
      spectral_lines(logs_, blocks_, with([](double t) { return std::sin(2 * std::numbers::pi * 4 * t); }), {1}, {});
  EXPECT_LT(found.p, 1e-6);
  EXPECT_NEAR(found.share, 0.5 / (0.5 + 16.0 / 25), 0.1);  // of the power below 16 of 25 Hz
}

TEST_F(StructureInTime, ALineMayBeSlowerThanTheBlocksOfALog) {
  blocks_.all.pop_back();
  for (Index part = 0; part < 5; ++part) blocks_.all.push_back({1, rows + part * rows / 5, rows / 5, false, true});
  const VectorXd e = with([](double t) { return 0.4 * std::sin(2 * std::numbers::pi * t / 13); });
  EXPECT_LT(spectral_lines(logs_, blocks_, e, {1, 2, 3, 4, 5}, {}).p, 1e-6);
  EXPECT_GT(spectral_lines(logs_, blocks_, e, {1, 3, 5}, {}).p, 1e-3);  // no two of them touch
}

TEST_F(StructureInTime, WandersWhereMeansDo) {
  const VectorXd e = with([](double t) { return t < 20 ? 0.5 : -0.5; });
  const TimeStructure found = slow_changes(logs_, blocks_, e, {1}, {});
  EXPECT_LT(found.p, 1e-6);
  EXPECT_NEAR(found.share, 0.25 / 1.25, 0.05);
}

// Means of 100 rows of variance 1: 20 of each session.
TEST_F(StructureInTime, TheChanceOfARatioIsThatOfF) {
  EXPECT_NEAR(chance(1, 20, 20), 0.5, 0.01);
  EXPECT_NEAR(chance(2.124, 20, 20), 0.05, 0.002);  // tables of F
  EXPECT_NEAR(chance(2.938, 20, 20), 0.01, 0.001);
}

}  // namespace
}  // namespace fxdyn::diagnosis
