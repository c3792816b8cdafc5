#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "host_tools/support/error.hpp"
#include "tests/diagnose/arm_sessions.hpp"
#include "tests/support/sanitizers.hpp"

// What is wrong with a recording gets a complaint, and no effect gets its name.

namespace fxdyn {
namespace {

using namespace test;
using Eigen::Index;
using Eigen::VectorXd;

/// The complaint about two sessions of an arm; "none" where there is a diagnosis.
std::string complaint(const std::string& name, const Sessions& sessions) {
  try {
    return "none: " + diagnosed(name, sessions).dump();
  } catch (const DataError& error) {
    return error.what();
  }
}

double number_after(const std::string& text, const std::string& words) {
  const auto at = text.find(words);
  return at == std::string::npos ? std::nan("") : std::stod(text.substr(at + words.size()));
}

TEST(RecordingFaults, AnEncoderThatSlippedSinceTheBaseline) {
  const std::string said = complaint("slipped", {.tamper = [](Log& log) { log.q.col(1).array() += 0.15; }});
  EXPECT_NE(said.find("elbow: its encoder slipped since the baseline"), std::string::npos) << said;
  EXPECT_NEAR(number_after(said, "best with "), -0.15, 0.03) << said;
}

TEST(RecordingFaults, AnEncoderThatSlippedFar) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  const std::string said = complaint("slipped_far", {.tamper = [](Log& log) { log.q.col(1).array() += 0.5; }});
  EXPECT_NE(said.find("elbow: its encoder slipped since the baseline"), std::string::npos) << said;
  EXPECT_NEAR(number_after(said, "best with "), -0.5, 0.05) << said;
}

// To an arm whose first joint lies, a base that tilts is an encoder that slipped.
TEST(RecordingFaults, ATiltIsNoSlipOfTheFirstJoint) {
  const json report = diagnosed("tilted", {.missing = effect("gravity_tilt", 0, "tilt_x = 0.0, tilt_y = 0.04")});
  // With two joints a compensator at the first one may explain it as well.
  const json there{report.at("robot_effects"), report.at("undecided")};
  EXPECT_NE(there.dump().find("gravity_tilt"), std::string::npos) << report.dump();
}

TEST(RecordingFaults, AnotherGainInOneLogIsNoLoad) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  const std::string said = complaint("one_gain", {.tamper = [](Log& log) {
                                       if (log.file.filename() == "a1.csv") log.tau.col(1) *= 1.3;
                                     }});
  EXPECT_EQ(said.find("another load"), std::string::npos) << said;
}

// A torque that comes late is how a drive samples, or an effect.
TEST(RecordingFaults, AConstantLagIsNoClock) {
  if (test::sanitized) GTEST_SKIP() << "other cases run the same code";
  const std::string said = complaint("late", {.tamper = [](Log& log) {
                                       const Eigen::MatrixXd tau = log.tau;
                                       log.tau.bottomRows(tau.rows() - 3) = tau.topRows(tau.rows() - 3);
                                     }});
  EXPECT_EQ(said.substr(0, 4), "none") << said;
}

TEST(RecordingFaults, PositionAndTorqueOfTwoClocks) {
  const std::string said = complaint("clocks", {.tamper = [](Log& log) {
                                       const VectorXd t = log.t, since = t.array() - t[0];
                                       const Eigen::MatrixXd tau = log.tau;
                                       const double step = (t[t.size() - 1] - t[0]) / static_cast<double>(t.size() - 1);
                                       for (Index k = 0; k < t.size(); ++k) {  // the torque's clock is 0.2 % fast
                                         const double place =
                                             std::min(1.002 * since[k] / step, static_cast<double>(t.size() - 2));
                                         const auto at = static_cast<Index>(place);
                                         const double share = place - static_cast<double>(at);
                                         log.tau.row(k) = (1 - share) * tau.row(at) + share * tau.row(at + 1);
                                       }
                                     }});
  EXPECT_NE(said.find("position and torque have two clocks"), std::string::npos) << said;
}

/// Derivative over +-10 samples.
VectorXd slope(const VectorXd& x, double step) {
  VectorXd out = VectorXd::Zero(x.size());
  for (Index k = 10; k + 10 < x.size(); ++k) out[k] = (x[k + 10] - x[k - 10]) / (20 * step);
  return out;
}

/// Torques of a point mass at the end of the arm's fore link, 0.3 m from the elbow.
void carry(Log& log, double mass) {
  const double upper = 0.4, fore = 0.3, step = log.t[1] - log.t[0];
  const VectorXd q1 = log.q.col(0), q2 = log.q.col(1), v1 = slope(q1, step), v2 = slope(q2, step);
  const VectorXd a1 = slope(v1, step), a2 = slope(v2, step);
  for (Index k = 0; k < q1.size(); ++k) {
    const double c = std::cos(q2[k]), s = std::sin(q2[k]), both = fore * fore + upper * fore * c;
    const double twist = upper * fore * s;
    const double pull = fore * std::cos(q1[k] + q2[k]);
    log.tau(k, 0) += mass * ((upper * upper + fore * fore + 2 * upper * fore * c) * a1[k] + both * a2[k] -
                             twist * v2[k] * (2 * v1[k] + v2[k]) - 9.81 * (upper * std::cos(q1[k]) + pull));
    log.tau(k, 1) += mass * (both * a1[k] + fore * fore * a2[k] + twist * v1[k] * v1[k] - 9.81 * pull);
  }
}

TEST(RecordingFaults, OneLogWithAnotherLoad) {
  const std::string said = complaint("one_load", {.tamper = [](Log& log) {
                                       if (log.file.filename() == "a2.csv") carry(log, 1.5);
                                     }});
  EXPECT_NE(said.find("a2.csv: recorded with another load than the other logs"), std::string::npos) << said;
  EXPECT_NEAR(number_after(said, "other logs ("), 1.5, 0.3) << said;
}

TEST(RecordingFaults, ALoadOfTheWholeSessionIsAnEffect) {
  const std::string said = complaint("all_load", {.tamper = [](Log& log) { carry(log, 1.5); }});
  EXPECT_NE(said.find("payload"), std::string::npos) << said;
  EXPECT_EQ(said.substr(0, 4), "none") << said;
}

}  // namespace
}  // namespace fxdyn
