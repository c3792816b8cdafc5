#include "host_tools/exchange/posterior.hpp"

#include <gtest/gtest.h>

namespace fxdyn {
namespace {

// k times the 90 % quantiles of F, of the tables in Abramowitz and Stegun 1964, 26.9: five digits.
TEST(RangesSet, RadiusIsFishersQuantile) {
  EXPECT_NEAR(squared_radius_90(1, 10), 3.2850, 2e-4);
  EXPECT_NEAR(squared_radius_90(2, 10), 2 * 2.9245, 2e-4);
  EXPECT_NEAR(squared_radius_90(3, 10), 3 * 2.7277, 2e-4);
  EXPECT_NEAR(squared_radius_90(3, 60), 3 * 2.1774, 2e-4);
  EXPECT_NEAR(squared_radius_90(1, 1), 39.863, 1e-2);
  // chi squared, of a covariance that is known
  EXPECT_NEAR(squared_radius_90(1, 1e7), 2.7055, 1e-4);
  EXPECT_NEAR(squared_radius_90(2, 1e7), 4.6052, 1e-4);
  EXPECT_NEAR(squared_radius_90(3, 1e7), 6.2514, 1e-4);
  EXPECT_EQ(squared_radius_90(0, 10), 0);
}

}  // namespace
}  // namespace fxdyn
