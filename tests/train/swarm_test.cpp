#include "host_tools/train/swarm.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

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

}  // namespace
}  // namespace fxdyn
