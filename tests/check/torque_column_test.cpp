#include "host_tools/check/torque_column.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <numbers>
#include <vector>

#include "host_tools/support/random.hpp"
#include "tests/support/chains.hpp"
#include "tests/support/kdl.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;

/// Dry friction with a memory, -1 .. 1: springs in parallel that slip one after the other, not Dahl's equation.
class SlippingSprings {
 public:
  explicit SlippingSprings(double path) : path_(path) {}
  double after(double moved) {
    double sum = 0;
    for (std::size_t i = 0; i < stretch_.size(); ++i) {
      const double most = path_ * spread[i];
      stretch_[i] = std::clamp(stretch_[i] + moved, -most, most);
      sum += stretch_[i] / most;
    }
    return sum / static_cast<double>(stretch_.size());
  }

 private:
  static constexpr std::array spread{0.2, 0.5, 1.0, 2.0};
  double path_;
  std::array<double, 4> stretch_{};
};

/// Twenty seconds of a robot with KDL's inverse dynamics and friction of another form than the check's. Its torque is
/// of `late_s` before its motion's time stamps.
struct Recording {
  Project project;
  Log log;

  /// @param path of dry friction with a memory [rad], as large as most of the other torques; 0: none
  explicit Recording(double late_s = 0, double path = 0) {
    project.robot = read_urdf(test::puma560);
    const Robot& robot = project.robot;
    const KDL::Chain chain = test::to_kdl(robot);
    KDL::ChainIdSolver_RNE solver(chain, KDL::Vector(robot.gravity.x(), robot.gravity.y(), robot.gravity.z()));
    constexpr Index samples = 5000;
    const auto n = static_cast<Index>(robot.size());
    log.file = "run.csv";
    log.step_s = 0.004;
    log.t = Eigen::VectorXd::LinSpaced(samples, 0, log.step_s * (samples - 1));
    log.q.resize(samples, n);
    log.tau.resize(samples, n);
    Random random(11);
    const auto angle = [&](double t, unsigned j, int derivative) {
      double sum = 0;
      for (int k = 1; k <= 3; ++k) {
        const double w = (0.7 + 0.21 * j) * k;
        sum += 0.6 / k * std::pow(w, derivative) * std::sin(w * t + j + k + derivative * std::numbers::pi / 2);
      }
      return sum;
    };
    const auto size = static_cast<unsigned>(robot.size());
    KDL::JntArray q(size), dq(size), ddq(size), tau(size);
    std::vector<SlippingSprings> springs(size, SlippingSprings(path));
    for (Index i = 0; i < samples; ++i) {
      for (unsigned j = 0; j < robot.size(); ++j) {
        log.q(i, j) = angle(log.t[i], j, 0);
        q(j) = angle(log.t[i] - late_s, j, 0);
        dq(j) = angle(log.t[i] - late_s, j, 1);
        ddq(j) = angle(log.t[i] - late_s, j, 2);
      }
      solver.CartToJnt(q, dq, ddq, KDL::Wrenches(chain.getNrOfSegments()), tau);
      for (unsigned j = 0; j < robot.size(); ++j) {
        const double scale = j < 3 ? 2.5 : 0.2;
        log.tau(i, j) =
            tau(j) + scale * std::copysign(std::sqrt(std::fabs(dq(j))), dq(j)) + 0.02 * scale * random.normal();
        if (path > 0) log.tau(i, j) += 6 * scale * springs[j].after(dq(j) * log.step_s);
      }
    }
  }

  std::vector<ProcessedLog> processed() const { return {process(log, choose_filter({log}, {}))}; }
  std::optional<TorqueLead> lead() const { return find_long_torque_lead(project, processed(), {}); }
};

TEST(TorqueColumn, ShortLeadsAreMeasured) {
  for (const double late : {0.0, 0.006, -0.004}) {
    const Recording recording(late);
    const MeasuredLead lead = torque_lead(recording.project, recording.processed(), {}).value();
    EXPECT_NEAR(lead.seconds, -late, 0.0025) << late;  // a quarter of the step
    EXPECT_NEAR(lead.seconds, -late, lead.resolution) << late;
    EXPECT_LT(lead.resolution, 0.02);
  }
  const Recording far(0.05);
  EXPECT_FALSE(torque_lead(far.project, far.processed(), {}));
}

TEST(TorqueColumn, OfTheMotionsTimeIsLeftAlone) { EXPECT_FALSE(Recording().lead().has_value()); }

TEST(TorqueColumn, OfAnotherTimeIsMeasured) {
  for (const double late : {0.04, -0.05}) {
    const auto lead = Recording(late).lead();
    ASSERT_TRUE(lead.has_value());
    EXPECT_NEAR(lead->seconds, -late, 1.5 * 0.004);  // samples: the rest is left to identify
    EXPECT_LT(lead->after, lead->before);
    Recording known(late);
    known.project.signals.torque_lead_s = -late;
    EXPECT_FALSE(known.lead().has_value());
  }
}

// Friction that builds up over a path after each reversal lags, as late torque does, but at the reversals alone.
TEST(TorqueColumn, FrictionWithAMemoryIsNotLate) {
  for (const double path : {0.003, 0.01}) {
    EXPECT_FALSE(Recording(0, path).lead().has_value()) << path;
    const auto late = Recording(0.03, path).lead();
    ASSERT_TRUE(late.has_value()) << path;
    EXPECT_NEAR(late->seconds, -0.03, 1.5 * 0.004) << path;
  }
}

TEST(TorqueColumn, ExchangedWithThePositionIsSeen) {
  Recording recording;
  EXPECT_FALSE(are_exchanged(recording.project, {recording.log}, {}));
  std::swap(recording.log.q, recording.log.tau);
  EXPECT_TRUE(are_exchanged(recording.project, {recording.log}, {}));
}

}  // namespace
}  // namespace fxdyn
