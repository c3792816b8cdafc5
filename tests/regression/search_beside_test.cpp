#include "host_tools/regression/search_beside.hpp"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace fxdyn {
namespace {

/// Values that are tried on the way to `truth`, the last one the best.
std::vector<double> tried(double start, double truth, double ratio, int rounds, double least = 1e-9,
                          double most = 1e9) {
  std::vector<double> values;
  double best = start, distance = std::fabs(std::log(start / truth));
  const auto make = [&](double value) { return std::pair{value, std::fabs(std::log(value / truth))}; };
  const auto accept = [&](const std::pair<double, double>& made) {
    values.push_back(made.first);
    if (made.second >= distance) return false;
    distance = made.second;
    return true;
  };
  search_beside(best, ratio, rounds, least, most, make, accept);
  values.push_back(best);
  return values;
}

TEST(SearchBeside, StepsByARatioThatShrinks) {
  EXPECT_EQ(tried(8, 8, 4, 2), (std::vector<double>{2, 32, 4, 16, 8}));
  // The first step down is better; the second round begins there.
  EXPECT_EQ(tried(8, 1, 4, 2), (std::vector<double>{2, 32, 1, 4, 1}));
}

TEST(SearchBeside, BothStepsOfARoundAreFromTheSameValue) {
  EXPECT_EQ(tried(8, 20, 4, 1), (std::vector<double>{2, 32, 32}));
}

TEST(SearchBeside, StaysWithinItsBounds) { EXPECT_EQ(tried(8, 1, 4, 1, 5, 10), (std::vector<double>{5, 10, 5})); }

}  // namespace
}  // namespace fxdyn
