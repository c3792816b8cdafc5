// The noise model of a joint's residual: an autoregression of order 6, and what is left once it is taken out.

#include <gtest/gtest.h>

#include "host_tools/diagnose/autoregression.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// e(k) = a1 e(k - 1) + a2 e(k - 2) + w(k), w of variance 1.
VectorXd coloured(Index samples, double a1, double a2, std::uint64_t seed) {
  Random random(seed);
  VectorXd e = VectorXd::Zero(samples);
  for (Index k = 2; k < samples; ++k) e[k] = a1 * e[k - 1] + a2 * e[k - 2] + random.normal();
  return e;
}

/// Of neighbours, -1 .. 1.
double correlation(const VectorXd& e) { return e.head(e.size() - 1).dot(e.tail(e.size() - 1)) / e.squaredNorm(); }

// Standard error of a coefficient: 1 / sqrt(samples) = 0.007.
constexpr Index samples = 20000;
constexpr double standard_error = 0.03;

TEST(NoiseModel, FindsTheCoefficientsOfAnAutoregression) {
  const VectorXd a = autoregression({coloured(samples, 1.2, -0.5, 1)});
  ASSERT_EQ(a.size(), 6);
  EXPECT_NEAR(a[0], 1.2, standard_error);
  EXPECT_NEAR(a[1], -0.5, standard_error);
  for (Index i = 2; i < 6; ++i) EXPECT_NEAR(a[i], 0, standard_error) << i;
}

TEST(NoiseModel, StretchesCountTogether) {
  const VectorXd e = coloured(samples, 0.9, 0, 2);
  const VectorXd a = autoregression({e.head(samples / 4), e.tail(samples / 2)});
  EXPECT_NEAR(a[0], 0.9, standard_error);
}

TEST(NoiseModel, WhiteNoiseAndNothingHaveNoColour) {
  EXPECT_LT(autoregression({coloured(samples, 0, 0, 3)}).cwiseAbs().maxCoeff(), standard_error);
  EXPECT_EQ(autoregression({VectorXd::Zero(100)}), VectorXd::Zero(6));
  EXPECT_EQ(autoregression({}), VectorXd::Zero(6));
}

TEST(NoiseModel, PrewhitenedNoiseIsWhiteAndOfItsVariance) {
  const VectorXd e = coloured(samples, 1.2, -0.5, 4);
  ASSERT_GT(correlation(e), 0.7);
  const VectorXd white = prewhitened(e, autoregression({coloured(samples, 1.2, -0.5, 5)}));
  EXPECT_NEAR(correlation(white), 0, standard_error);
  EXPECT_NEAR(white.squaredNorm() / static_cast<double>(samples), 1, 0.05);
}

TEST(NoiseModel, WhatHasNoPastIsLeftOut) {
  const VectorXd one = VectorXd::Ones(10), half = VectorXd::Constant(2, 0.25);
  const VectorXd out = prewhitened(one, half);
  EXPECT_EQ(out.head(2), VectorXd::Zero(2));
  EXPECT_EQ(out.tail(8), VectorXd::Constant(8, 0.5));
  EXPECT_EQ(prewhitened(VectorXd::Ones(1), half), VectorXd::Zero(1));  // shorter than the past
}

}  // namespace
}  // namespace fxdyn::diagnosis
