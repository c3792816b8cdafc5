#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "host_tools/signals/filter.hpp"
#include "host_tools/signals/spectrum.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double step = 0.001;

VectorXd sampled(Index n, double h, auto function) {
  VectorXd x(n);
  for (Index i = 0; i < n; ++i) x[i] = function(static_cast<double>(i) * h);
  return x;
}

class FilterOrder : public testing::TestWithParam<int> {};

TEST_P(FilterOrder, HasTheGainOfButterworthTwiceAndNoPhase) {
  const int order = GetParam();
  const double cutoff = 20;
  const ZeroPhaseFilter filter(cutoff, step, order);
  const double pi = std::numbers::pi;
  for (const double hz : {1.0, 5.0, 15.0, 20.0, 30.0, 60.0}) {
    const Index n = 4000, from = 1000, count = 2000;  // whole periods, away from the ends
    const VectorXd y = filter.apply(sampled(n, step, [&](double t) { return std::sin(2 * pi * hz * t); }));
    const VectorXd sine = sampled(n, step, [&](double t) { return std::sin(2 * pi * hz * t); }).segment(from, count);
    const VectorXd cosine = sampled(n, step, [&](double t) { return std::cos(2 * pi * hz * t); }).segment(from, count);
    // |H|^2 of the analog filter at the frequency that the bilinear transform makes of hz.
    const double warped = std::tan(pi * hz * step) / std::tan(pi * cutoff * step);
    const double gain = 1 / (1 + std::pow(warped, 2 * order));
    EXPECT_NEAR(2 * y.segment(from, count).dot(sine) / count, gain, 1e-6) << hz << " Hz";
    EXPECT_NEAR(2 * y.segment(from, count).dot(cosine) / count, 0, 1e-6) << hz << " Hz";
  }
}
INSTANTIATE_TEST_SUITE_P(Orders, FilterOrder, testing::Values(1, 2, 3, 4, 5));

TEST(Filter, ConstantsAndRampsPassUnchanged) {
  const ZeroPhaseFilter filter(10, step);
  for (const Index n : {3, 20, 500, 5000}) {
    Eigen::MatrixXd x(n, 2);
    x.col(0).setConstant(7.5);
    x.col(1) = sampled(n, step, [](double t) { return 3 - 40 * t; });
    EXPECT_LT((filter.apply(x) - x).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(Filter, StartIsForgottenAtTheEdge) {
  // The same signal seen through a shorter window differs only near the window's ends.
  const ZeroPhaseFilter filter(20, step);
  const VectorXd x = sampled(6000, step, [](double t) { return std::sin(9 * t) + 0.3 * std::cos(31 * t + 1) + t * t; });
  const VectorXd whole = filter.apply(x), part = filter.apply(x.segment(2000, 2000));
  const Index edge = filter.edge_samples();
  EXPECT_GT(edge, 50);
  EXPECT_LT(edge, 200);
  const Index inside = 2000 - 2 * edge;
  EXPECT_LT((whole.segment(2000 + edge, inside) - part.segment(edge, inside)).cwiseAbs().maxCoeff(), 2e-3);
  EXPECT_LT((whole - x).segment(3 * edge, 6000 - 6 * edge).cwiseAbs().maxCoeff(),
            1e-3);  // all of it is in the pass band
}

TEST(Filter, CutoffNearNyquistIsTheIdentity) {
  const VectorXd x = VectorXd::Random(100);
  for (const double cutoff : {0.0, 475.0, 1000.0}) {
    const ZeroPhaseFilter filter(cutoff, step);
    EXPECT_EQ(filter.apply(x), x);
    EXPECT_EQ(filter.edge_samples(), 0);
  }
}

TEST(Filter, ShortAndEmptyColumns) {
  const ZeroPhaseFilter filter(10, step);
  EXPECT_EQ(filter.apply(Eigen::MatrixXd(0, 3)).cols(), 3);
  EXPECT_EQ(filter.apply(Eigen::MatrixXd(5, 0)).rows(), 5);
  EXPECT_EQ(filter.apply(VectorXd::Ones(1))(0), 1);
}

/// Largest error over n samples of [0, 1].
double error(Index n, int derivative) {
  const double h = 1 / static_cast<double>(n - 1);
  const VectorXd x = sampled(n, h, [](double t) { return std::sin(6 * t) + std::exp(t); });
  const VectorXd exact = sampled(n, h, [derivative](double t) {
    return derivative == 1 ? 6 * std::cos(6 * t) + std::exp(t) : -36 * std::sin(6 * t) + std::exp(t);
  });
  return ((derivative == 1 ? differentiate(x, h) : differentiate_twice(x, h)) - exact).cwiseAbs().maxCoeff();
}

TEST(Differentiate, ConvergesWithTheSixthOrder) {
  for (const int derivative : {1, 2}) {
    const double order = std::log2(error(41, derivative) / error(81, derivative));
    EXPECT_GT(order, 5.6) << derivative;
    EXPECT_LT(order, 6.6) << derivative;
  }
}

TEST(Differentiate, PolynomialsAreExactEvenInShortLogs) {
  for (const Index n : {3, 4, 6, 7, 8, 9, 30}) {
    const VectorXd x = sampled(n, 0.1, [](double t) { return 1 + 2 * t + 3 * t * t; });
    const VectorXd slope = sampled(n, 0.1, [](double t) { return 2 + 6 * t; });
    EXPECT_LT((differentiate(x, 0.1) - slope).cwiseAbs().maxCoeff(), 1e-10) << n;
    EXPECT_LT((differentiate_twice(x, 0.1).array() - 6).abs().maxCoeff(), 1e-9) << n;
  }
  EXPECT_EQ(differentiate(VectorXd::Ones(1), 0.1)(0), 0);
}

// Two recordings of one joint, each with its own spacing of frequencies: 9 J at 2 Hz, 0.9 J at 10 Hz.
TEST(Energy, AddsUpOverRecordings) {
  const auto density = [](double resolution_hz, double hz) {
    Spectrum s{resolution_hz, VectorXd::Zero(static_cast<Index>(20 / resolution_hz))};
    s.density[static_cast<Index>(std::lround(hz / resolution_hz))] = 1 / resolution_hz;
    s.density[0] = 1e6;  // a mean is no motion
    return s;
  };
  EnergyByFrequency both;
  both.add(density(0.5, 2), 30, 9);
  both.add(density(0.25, 10), 30, 0.9);
  EXPECT_DOUBLE_EQ(both.frequency_of_share(0.9), 2);
  EXPECT_DOUBLE_EQ(both.frequency_of_share(0.92), 10);
  both.add(density(0.5, 15), 14, 100);  // above its ceiling
  EXPECT_DOUBLE_EQ(both.frequency_of_share(0.999), 10);

  EnergyByFrequency weak, joints, nothing;
  weak.add(density(0.5, 12), 30, 1e-6);
  joints.add_shares(both);
  joints.add_shares(weak);  // counts as much as the other
  joints.add_shares(nothing);
  EXPECT_DOUBLE_EQ(joints.frequency_of_share(0.49), 10);
  EXPECT_DOUBLE_EQ(joints.frequency_of_share(0.51), 12);
  EXPECT_EQ(nothing.frequency_of_share(0.5), 0);
}

}  // namespace
}  // namespace fxdyn
