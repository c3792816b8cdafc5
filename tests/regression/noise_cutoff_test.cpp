#include "host_tools/regression/noise_cutoff.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "host_tools/regression/dataset.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double inertia = 2, friction = 5, viscous = 3, noise = 1e-5;  // kg m^2, N*m, N*m*s/rad, rad

/// 20 s of a joint that swings at 0.7 and 1.1 Hz, with white noise on its encoder.
Log swing(double rate_hz, double noise_rad) {
  Log log;
  log.step_s = 1 / rate_hz;
  const auto samples = static_cast<Index>(20 * rate_hz);
  log.t = VectorXd::LinSpaced(samples, 0, log.step_s * static_cast<double>(samples - 1));
  log.q.resize(samples, 1);
  log.tau.resize(samples, 1);
  Random random(7);
  for (Index k = 0; k < samples; ++k) {
    double q = 0, dq = 0, ddq = 0;
    for (const double w : {2 * std::numbers::pi * 0.7, 2 * std::numbers::pi * 1.1}) {
      q += 0.3 * std::sin(w * log.t[k]);
      dq += 0.3 * w * std::cos(w * log.t[k]);
      ddq -= 0.3 * w * w * std::sin(w * log.t[k]);
    }
    log.q(k, 0) = q + noise_rad * random.normal();
    log.tau(k, 0) = inertia * ddq + viscous * dq + friction * std::copysign(1.0, dq);
  }
  return log;
}

double rms(const Log& log) { return log.tau.norm() / std::sqrt(static_cast<double>(log.samples())); }

// The rule itself: at the cut-off, differentiated noise times inertia and friction is one per cent of the torque.
TEST(NoiseCutoff, LeavesOnePerCentOfTheTorque) {
  const Log log = swing(1000, noise), clean = swing(1000, 0);
  const double cutoff = noise_cutoff({log}, 5, {0}, {true});
  const ZeroPhaseFilter filter(cutoff, log.step_s);
  const VectorXd left = filter.apply(log.q - clean.q);
  const VectorXd torque = inertia * differentiate_twice(left, log.step_s) + viscous * differentiate(left, log.step_s);
  const double share = torque.norm() / std::sqrt(static_cast<double>(log.samples())) / rms(log);
  EXPECT_NEAR(share, noise_share, 0.15 * noise_share);  // 0.0098: the filter is no wall
}

// White noise of so many rad a sample is spread over half the rate: what is allowed follows from the density.
TEST(NoiseCutoff, DependsOnTheDensityAndNotOnTheRate) {
  const double slow = noise_cutoff({swing(500, noise)}, 5, {0}, {true}),
               fast = noise_cutoff({swing(4000, noise * std::sqrt(8.0))}, 5, {0}, {true});
  EXPECT_NEAR(fast / slow, 1, 0.05);
}

TEST(NoiseCutoff, CountsTheStepOfAnEncoder) {
  Log log = swing(1000, 0);
  const double step = 1e-3;
  log.q = (log.q / step).array().round() * step;
  const double of_step = noise_cutoff({log}, 5, {step}, {true});
  // the same density as noise
  const double of_noise = noise_cutoff({swing(1000, step / std::sqrt(12.0))}, 5, {0}, {true});
  EXPECT_NEAR(of_step / of_noise, 1, 0.15);
}

TEST(NoiseCutoff, MeasuredVelocityIsDifferentiatedOnce) {
  Log log = swing(1000, 0);
  log.dq = differentiate(log.q, log.step_s);
  Random random(3);
  const double noise_of_dq = 1e-2;
  for (Index k = 0; k < log.samples(); ++k) log.dq(k, 0) += noise_of_dq * random.normal();
  const double cutoff = noise_cutoff({log}, 5, {0}, {true});
  const double density = noise_of_dq * noise_of_dq * 2 * log.step_s, w = 2 * std::numbers::pi;
  const double torque =
      std::sqrt(density * (inertia * inertia * w * w * std::pow(cutoff, 3) / 3 + viscous * viscous * cutoff));
  EXPECT_NEAR(torque / rms(log), noise_share, 0.1 * noise_share);
}

TEST(NoiseCutoff, NothingIsFilteredWithoutTorqueNoiseOrMotion) {
  Log log = swing(1000, 0);
  EXPECT_GT(noise_cutoff({log}, 5, {0}, {true}), 400);
  log = swing(1000, noise);
  EXPECT_TRUE(std::isinf(noise_cutoff({log}, 5, {0}, {false})));
  log.tau.resize(0, 0);
  EXPECT_TRUE(std::isinf(noise_cutoff({log}, 5, {0}, {true})));
}

// What a user gets: 5 kHz and a noisy encoder. By the crossing of motion and noise alone it was 1157 Hz on such a log.
TEST(NoiseCutoff, DefaultOfAFastNoisyLog) {
  const FilterFit filter = choose_filter({swing(5000, 1e-4)}, {});
  EXPECT_LT(filter.position_cutoff_hz, 40);
  EXPECT_GE(filter.position_cutoff_hz, 2 * filter.excited_hz);
  EXPECT_LE(filter.torque_cutoff_hz, filter.position_cutoff_hz);
  SignalSettings given;
  given.position_cutoff_hz = 300;
  EXPECT_EQ(choose_filter({swing(5000, 1e-4)}, given).position_cutoff_hz, 300);
}

}  // namespace
}  // namespace fxdyn
