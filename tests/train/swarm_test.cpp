#include "host_tools/train/swarm.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>
#include <vector>

#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd each(const MatrixXd& x, double (*value)(const VectorXd&)) {
  VectorXd out(x.cols());
  for (Index p = 0; p < x.cols(); ++p) out[p] = value(x.col(p));
  return out;
}

double sphere(const VectorXd& x) { return (x.array() - 0.3).square().sum(); }

/// Many local minima; the least is 0 at 0.3.
double rastrigin(const VectorXd& x) {
  double sum = 0;
  for (const double v : x) sum += std::pow(v - 0.3, 2) + 1 - std::cos(2 * std::numbers::pi * (v - 0.3));
  return sum;
}

Swarm run(Swarm swarm, double (*value)(const VectorXd&)) {
  while (!swarm.finished()) swarm.tell(each(swarm.positions(), value));
  return swarm;
}

Swarm box(Index dimensions, const SwarmSettings& settings) {
  return {VectorXd::Constant(dimensions, -2), VectorXd::Constant(dimensions, 5), settings};
}

TEST(Swarm, FindsTheLeastOfASmoothFunction) {
  SwarmSettings settings;
  settings.iterations = 150;
  settings.stall = 150;
  const Swarm swarm = run(box(5, settings), sphere);
  EXPECT_LT(swarm.best_value(), 1e-8);
  EXPECT_LT((swarm.best().array() - 0.3).abs().maxCoeff(), 1e-4);
}

TEST(Swarm, LeavesLocalMinima) {
  int found = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SwarmSettings settings;
    settings.iterations = 150;
    settings.stall = 150;
    settings.seed = seed;
    found += run(box(4, settings), rastrigin).best_value() < 1e-3;
  }
  EXPECT_GE(found, 8);
}

TEST(Swarm, StaysInTheBoxAndStartsAllOverIt) {
  SwarmSettings settings;
  Swarm swarm = box(2, settings);
  for (Index i = 0; i < 2; ++i) {
    EXPECT_LT(swarm.positions().row(i).minCoeff(), -0.5);
    EXPECT_GT(swarm.positions().row(i).maxCoeff(), 3.5);
  }
  // The least lies in a corner.
  while (!swarm.finished()) {
    EXPECT_GE(swarm.positions().minCoeff(), -2);
    EXPECT_LE(swarm.positions().maxCoeff(), 5);
    swarm.tell(each(swarm.positions(), [](const VectorXd& x) { return x.sum(); }));
  }
  EXPECT_DOUBLE_EQ(swarm.best_value(), -4);
}

TEST(Swarm, GoesOnWhereItWasInterrupted) {
  SwarmSettings settings;
  const Swarm whole = run(box(3, settings), rastrigin);
  Swarm first = box(3, settings);
  for (int k = 0; k < 7; ++k) first.tell(each(first.positions(), rastrigin));
  const std::string file = first.to_json().dump();
  Swarm second = box(3, settings);
  second.from_json(nlohmann::json::parse(file));
  second = run(second, rastrigin);
  EXPECT_EQ(second.best(), whole.best());
  EXPECT_EQ(second.best_value(), whole.best_value());
  EXPECT_EQ(second.generation(), whole.generation());
}

TEST(Swarm, RefusesAnotherSwarmsState) {
  const Swarm small = box(3, {});
  Swarm large = box(4, {});
  EXPECT_THROW(large.from_json(small.to_json()), InputError);
}

TEST(Swarm, StopsWhenNothingIsFoundAnyMore) {
  SwarmSettings settings;
  settings.stall = 4;
  const Swarm swarm = run(box(2, settings), [](const VectorXd&) { return 1.0; });
  EXPECT_EQ(swarm.generation(), 5);  // the first finds 1.0
}

TEST(Swarm, ValuesThatAreNoNumbersAreWorseThanAny) {
  Swarm swarm = box(2, {});
  VectorXd values = each(swarm.positions(), sphere);
  values[3] = std::numeric_limits<double>::quiet_NaN();
  values[4] = -std::numeric_limits<double>::infinity();
  const double least = std::min(values.head(3).minCoeff(), values.tail(values.size() - 5).minCoeff());
  swarm.tell(values);
  EXPECT_EQ(swarm.best_value(), least);
}

TEST(Swarm, ASeedIsAnOutcome) {
  SwarmSettings one, two;
  two.seed = 2;
  EXPECT_EQ(run(box(3, one), rastrigin).best(), run(box(3, one), rastrigin).best());
  EXPECT_NE(run(box(3, one), rastrigin).best(), run(box(3, two), rastrigin).best());
}

/// One step, computed by hand: a swarm put where nothing but the part of the formula in question moves it.
/// Every dimension draws its own r, so that thousands of them show the factor in front of it.
struct Step {
  static constexpr Index dimensions = 4000;
  double own = 0, common = 0, velocity = 0;  ///< p - x, g - x, v, the same in every dimension
  int generation = 1;                        ///< which one is told now
  double largest_step = 1;                   ///< of a box of 20: no bound here

  SwarmSettings settings() const {
    SwarmSettings s;
    s.particles = 1;
    s.iterations = 41;
    s.stall = 1000;
    s.neighbourly = 0;  // the best of all is followed
    s.largest_step = largest_step;
    return s;
  }

  /// The velocity that the particle has after it.
  VectorXd taken() const {
    Swarm swarm(VectorXd::Constant(dimensions, -10), VectorXd::Constant(dimensions, 10), settings());
    nlohmann::json state = swarm.to_json();
    const auto all = [](double value) {
      return std::vector<std::vector<double>>{std::vector<double>(dimensions, value)};
    };
    state["positions"] = all(0);
    state["velocities"] = all(velocity);
    state["own_best"] = all(own);
    state["own_value"] = {{-1.0}};  // better than what is told
    state["best"] = all(common);
    state["best_value"] = state["milestone"] = -2.0;
    state["generation"] = generation - 1;
    swarm.from_json(state);
    swarm.tell(VectorXd::Zero(1));
    const VectorXd v = Eigen::Map<const VectorXd>(
        swarm.to_json().at("velocities").at(0).get<std::vector<double>>().data(), dimensions);
    EXPECT_LT((swarm.positions().col(0) - v).cwiseAbs().maxCoeff(), 1e-12);  // x = 0 + v (Eq. 36)
    return v;
  }
};

/// chi = 2 / |2 - 4.1 - sqrt(4.1^2 - 16.4)| = 2 / 2.740312: Eq. 33 put right, c1 = c2 = 2.05.
constexpr double pull = 0.7298437881 * 2.05;

/// r is uniform in [0, 1): the largest of 4000 is within 0.3 % of 1 (but for 6e-6), the mean within 4 standard
/// deviations.
void expect_uniform_up_to(double factor, const VectorXd& v) {
  const auto n = static_cast<double>(v.size());
  EXPECT_GE(v.minCoeff(), 0);
  EXPECT_LT(v.maxCoeff(), factor);
  EXPECT_GT(v.maxCoeff(), 0.997 * factor);
  EXPECT_NEAR(v.mean(), 0.5 * factor, 4 * factor / std::sqrt(12 * n));
}

TEST(SwarmStep, PullsWithTheConstrictionOfEquation33) {
  Step own;
  own.own = 1;
  expect_uniform_up_to(pull, own.taken());
  Step common;
  common.common = 1;
  expect_uniform_up_to(pull, common.taken());
}

TEST(SwarmStep, DrawsForBothPullsAndEveryDimension) {
  Step both;
  both.own = 1;
  both.common = -1;
  const VectorXd v = both.taken() / pull;  // r1 - r2: triangular, variance 1/6
  EXPECT_NEAR(v.mean(), 0, 4 / std::sqrt(6.0 * Step::dimensions));
  // (r1 - r2)^2 has a variance of 1/15 - 1/36
  EXPECT_NEAR(v.squaredNorm() / Step::dimensions, 1.0 / 6, 4 * std::sqrt((1 / 15.0 - 1 / 36.0) / Step::dimensions));
}

TEST(SwarmStep, InertiaFallsLinearlyAsInEquation37) {
  Step step;
  step.velocity = 2;
  // 0.6 at the first generation, 0.3 at the last, 0.45 halfway; and no chi in front of it once more.
  for (const auto& [generation, inertia] : {std::pair(1, 0.6), {21, 0.45}, {31, 0.375}, {41, 0.3}}) {
    step.generation = generation;
    const VectorXd v = step.taken();
    EXPECT_NEAR(v.minCoeff(), 2 * inertia, 1e-12) << generation;
    EXPECT_NEAR(v.maxCoeff(), 2 * inertia, 1e-12) << generation;
  }
}

TEST(SwarmStep, IsNoLongerThanItsBound) {
  Step step;
  step.velocity = 6;
  step.largest_step = 0.1;  // of a box of 20
  EXPECT_EQ(step.taken(), VectorXd::Constant(Step::dimensions, 2));
}

/// Which one each of ten particles follows while only neighbours are: the best of two on either side of it in the ring.
TEST(SwarmStep, FollowsTheBestOfItsNeighboursInTheRing) {
  constexpr Index d = 1, n = 10;
  SwarmSettings settings;
  settings.particles = static_cast<int>(n);
  settings.neighbourly = 1;
  Swarm swarm(VectorXd::Constant(d, -10), VectorXd::Constant(d, 10), settings);
  nlohmann::json state = swarm.to_json();
  std::vector<double> values;
  for (Index p = 0; p < n; ++p) {
    const auto at = static_cast<std::size_t>(p);
    state["positions"][at] = state["velocities"][at] = {0.0};
    // Particle 8 has found the best, at 1; particle 4 the second best, at -1; the others nothing, at 0.
    state["own_best"][at] = {p == 8 ? 1.0 : p == 4 ? -1.0 : 0.0};
    values.push_back(p == 8 ? -3 : p == 4 ? -2 : -1);
  }
  state["own_value"] = {values};
  state["best"] = {{1.0}};
  state["best_value"] = state["milestone"] = -3.0;
  state["generation"] = 0;
  swarm.from_json(state);
  swarm.tell(VectorXd::Zero(n));
  const std::array followed{1, 0, -1, -1, -1, -1, 1, 1, 1, 1};  // 6 has both within reach: the better one
  for (Index p = 0; p < n; ++p) {
    const double x = swarm.positions()(0, p);
    const int way = followed[static_cast<std::size_t>(p)];
    if (p == 4 || p == 8) {
      EXPECT_EQ(way > 0, x > 0) << p;  // pulled to its own best, too
    } else {
      EXPECT_EQ((x > 0) - (x < 0), way) << p;
    }
  }
}

}  // namespace
}  // namespace fxdyn
