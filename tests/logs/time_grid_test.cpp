#include "host_tools/logs/time_grid.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

Log of_stamps(std::initializer_list<double> stamps) {
  Log log;
  log.t = Eigen::Map<const Eigen::VectorXd>(stamps.begin(), static_cast<Eigen::Index>(stamps.size()));
  log.q = 2 * log.t;
  return log;
}

TEST(TimeGrid, UniformStampsHaveTheMeanStep) {
  Log log = of_stamps({1, 1.1, 1.2, 1.3});
  EXPECT_NEAR(check_stamps(log, "f"), 0.1, 1e-12);
  EXPECT_FALSE(log.resampled);
}

TEST(TimeGrid, IrregularOnesHaveTheMedianAndALineStaysOne) {
  Log log = of_stamps({0, 0.1, 0.25, 0.35, 0.45});
  const double step = check_stamps(log, "f");
  EXPECT_NEAR(step, 0.1, 1e-12);
  EXPECT_TRUE(log.resampled);
  resample(log, step);
  ASSERT_EQ(log.samples(), 5);
  EXPECT_TRUE(log.q.isApprox(2 * log.t, 1e-12));
  EXPECT_NEAR(log.t[4], 0.4, 1e-12);
}

TEST(TimeGrid, AGapIsRefused) {
  Log log = of_stamps({0, 0.1, 0.2, 1.3, 1.4});
  try {
    check_stamps(log, "file.csv");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("file.csv: gap of 1.1 s after t = 0.2 s"), std::string::npos)
        << error.what();
  }
}

TEST(TimeGrid, JumpsByATurnGoAndOthersStay) {
  constexpr double turn = 2 * std::numbers::pi;
  Eigen::VectorXd angle(5);
  angle << 3.0, 3.1, 3.2 - turn, 3.3 - turn, 5.8 - turn;
  unwrap(angle);
  Eigen::VectorXd expected(5);
  expected << 3.0, 3.1, 3.2, 3.3, 5.8;
  EXPECT_TRUE(angle.isApprox(expected, 1e-12)) << angle.transpose();
}

}  // namespace
}  // namespace fxdyn
