// Separable least squares on small data: what is nonlinear is found by damped Gauss-Newton.

#include "host_tools/regression/gauss_newton.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Step = std::optional<VectorXd>;

/// y = amplitude exp(-rate t)
struct Decay {
  VectorXd t = VectorXd::LinSpaced(50, 0, 2), y = 3 * (-1.7 * t.array()).exp();
  double amplitude = 0;

  VectorXd column(double rate) const { return (-rate * t.array()).exp(); }
  double square(double rate) {
    const VectorXd x = column(rate);
    amplitude = x.dot(y) / x.squaredNorm();
    return (y - amplitude * x).squaredNorm();
  }
  VectorXd step(double rate) {
    square(rate);
    MatrixXd x(t.size(), 2);
    x << column(rate), -amplitude * t.cwiseProduct(column(rate));
    return x.householderQr().solve(y - amplitude * column(rate)).tail(1);
  }
};

TEST(GaussNewton, FindsTheShapeAndTheCoefficient) {
  Decay decay;
  double best = decay.square(0.5);
  int rounds = 0;
  const VectorXd rate = gauss_newton(
      VectorXd::Constant(1, 0.5), {.most_rounds = 50, .tolerance = 1e-10},
      [&](const VectorXd& x, int) { return ++rounds, Step(decay.step(x[0])); },
      [&](const VectorXd& x, int) {
        const double now = decay.square(x[0]);
        return now <= best ? (best = now, true) : false;
      });
  EXPECT_NEAR(rate[0], 1.7, 1e-8);
  decay.square(rate[0]);
  EXPECT_NEAR(decay.amplitude, 3, 1e-8);
  EXPECT_LT(rounds, 15);
}

TEST(GaussNewton, ShortensAStepThatLeadsAway) {
  // From 3 the full steps to the root of atan diverge.
  double now = std::atan(3.0);
  const VectorXd x = gauss_newton(
      VectorXd::Constant(1, 3), {.most_rounds = 50, .tolerance = 1e-12},
      [](const VectorXd& at, int) { return Step(VectorXd::Constant(1, -std::atan(at[0]) * (1 + at[0] * at[0]))); },
      [&](const VectorXd& at, int) {
        const double there = std::fabs(std::atan(at[0]));
        return there <= now ? (now = there, true) : false;
      });
  EXPECT_NEAR(x[0], 0, 1e-12);
}

TEST(GaussNewton, EndsWhereNoShareOfTheStepIsBetter) {
  int tried = 0;
  const VectorXd x = gauss_newton(
      VectorXd::Zero(2), {.most_tries = 3, .shrink = 0.5}, [](const VectorXd&, int) { return Step(VectorXd::Ones(2)); },
      [&](const VectorXd&, int) { return ++tried < 0; });
  EXPECT_EQ(tried, 3);  // 1, 1/2, 1/4
  EXPECT_EQ(x, VectorXd::Zero(2));
}

TEST(GaussNewton, KeepsTheBounds) {
  const GaussNewton rules{.lower = VectorXd::Constant(1, -1), .upper = VectorXd::Constant(1, 2)};
  const auto up = [](const VectorXd&, int round) { return round < 3 ? Step(VectorXd::Constant(1, 5)) : std::nullopt; };
  EXPECT_EQ(gauss_newton(VectorXd::Zero(1), rules, up, [](const VectorXd&, int) { return true; })[0], 2);
}

// Each unknown goes a share of its own: the second one's full steps lead eight times too far.
TEST(GaussNewton, TakesBackThePartsOfAStepThatAreWorse) {
  VectorXd reach = VectorXd::Ones(2);
  const auto step = [](const VectorXd& x, int) { return Step(-x.cwiseProduct(Eigen::Vector2d(1, 8))); };
  const auto move = [&](const VectorXd& x, const VectorXd& full, double) {
    return VectorXd(x + reach.cwiseProduct(full));
  };
  const auto accept = [&](const VectorXd& x, VectorXd& next, int) {
    for (Index i = 0; i < 2; ++i) {
      if (std::fabs(next[i]) <= std::fabs(x[i])) continue;
      next[i] = x[i];
      reach[i] /= 8;
    }
    return Trial::accepted;
  };
  const VectorXd x = gauss_newton(VectorXd(Eigen::Vector2d(3, 1)), {.most_rounds = 8}, step, move, accept);
  EXPECT_EQ(x, VectorXd::Zero(2));
  EXPECT_EQ(reach, VectorXd(Eigen::Vector2d(1, 0.125)));
}

/// Counts what the engine asks for. The unknown need not be a vector.
struct Calls {
  std::vector<Trial> trials;  ///< the answers; then all are accepted
  int steps = 0, moves = 0;
  std::vector<double> shares{};

  std::string run(int most_rounds, int most_tries = 4) {
    return gauss_newton(
        std::string("x"), {.most_rounds = most_rounds, .most_tries = most_tries, .shrink = 0.5},
        [&](const std::string&, int) { return std::optional(steps++); },
        [&](const std::string& x, int, double share) { return ++moves, shares.push_back(share), x + "."; },
        [&](const std::string&, const std::string&, int) {
          const auto i = static_cast<std::size_t>(moves - 1);
          return i < trials.size() ? trials[i] : Trial::accepted;
        });
  }
};

TEST(GaussNewton, StopsAtTheLastRound) {
  Calls calls{{}};
  EXPECT_EQ(calls.run(3), "x...");
  EXPECT_EQ(calls.steps, 3);
}

TEST(GaussNewton, KeepsAConvergedStepAndEnds) {
  Calls calls{{Trial::accepted, Trial::rejected, Trial::converged}};
  EXPECT_EQ(calls.run(10), "x..");
  EXPECT_EQ(calls.steps, 2);
  EXPECT_EQ(calls.shares, (std::vector<double>{1, 1, 0.5}));
}

TEST(GaussNewton, GivesUpWithoutAShorterStep) {
  Calls calls{{Trial::accepted, Trial::given_up}};
  EXPECT_EQ(calls.run(10), "x.");
  EXPECT_EQ(calls.moves, 2);
}

TEST(GaussNewton, TriesAStepAsOftenAsItMay) {
  Calls calls{std::vector<Trial>(10, Trial::rejected)};
  EXPECT_EQ(calls.run(10, 3), "x");
  EXPECT_EQ(calls.steps, 1);
  EXPECT_EQ(calls.shares, (std::vector<double>{1, 0.5, 0.25}));
}

}  // namespace
}  // namespace fxdyn
