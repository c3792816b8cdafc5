#include "host_tools/diagnose/load_places.hpp"

#include <gtest/gtest.h>

#include "host_tools/support/random.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

const Vector3d centre(0.09, -0.05, 0.12);
constexpr double mass = 0.14;

MomentsOfLoad moments(double m, const Vector3d& first) { return m * moments_at(first / m); }

TEST(LoadPlaces, MomentsOfAPointMass) {
  const MomentsOfLoad at = moments_at(centre);
  EXPECT_EQ(at[0], 1);
  EXPECT_EQ(at.segment<3>(1), centre);
  EXPECT_DOUBLE_EQ(at[4], 0.0081);
  EXPECT_DOUBLE_EQ(at[7], 0.09 * -0.05);
  EXPECT_DOUBLE_EQ(at[9], -0.05 * 0.12);
}

TEST(LoadPlaces, ChangesAroundAMassAreDerivatives) {
  const auto around = moments_around(centre);
  const Vector3d first = mass * centre;
  constexpr double step = 1e-6;
  for (Index k = 0; k < 4; ++k) {
    Vector3d more = first, less = first;
    if (k > 0) more[k - 1] += step, less[k - 1] -= step;
    const double m = k == 0 ? step : 0;
    const MomentsOfLoad slope = (moments(mass + m, more) - moments(mass - m, less)) / (2 * step);
    EXPECT_LT((slope - around.col(k)).norm(), 1e-7) << k;
  }
  // The torque of the mass itself is that of the columns around it.
  EXPECT_LT((around * Eigen::Vector4d(mass, first.x(), first.y(), first.z()) - moments(mass, first)).norm(), 1e-15);
}

TEST(LoadPlaces, TorquesOfTenPlacesMakeThoseOfAnyBody) {
  Random random(3);
  const MatrixXd by_moment =
      MatrixXd::NullaryExpr(5, moments_of_load, [&] { return random.normal(); });  // torque of a unit of each
  MatrixXd by_place(5, moments_of_load);
  const std::vector<Vector3d> places{{0, 0, 0}, {1, 0, 0},  {-1, 0, 0}, {0, 1, 0}, {0, -1, 0},
                                     {0, 0, 1}, {0, 0, -1}, {1, 1, 0},  {1, 0, 1}, {0, 1, 1}};
  for (Index i = 0; i < moments_of_load; ++i)
    by_place.col(i) = by_moment * moments_at(places[static_cast<std::size_t>(i)]);
  EXPECT_LT((by_place * moments_from_places() - by_moment).norm(), 1e-12);
}

/// Torques in which the second moment counts as on a small wrist, with noise of 1 %.
struct Torques {
  MatrixXd columns;
  VectorXd y;
  explicit Torques(const MomentsOfLoad& load) {
    Random random(8);
    columns = MatrixXd::NullaryExpr(400, moments_of_load, [&] { return random.normal(); });
    columns.col(0) *= 0.1;                  // hardly felt without a lever
    columns.rightCols<6>() *= 20;           // accelerates faster than it falls
    columns.col(0) += columns.col(4) / 40;  // .. and its weight looks like what brakes it
    y = columns * load;
    y += VectorXd::NullaryExpr(400, [&] { return random.normal(); }) * 0.01 * y.norm() / 20;
  }
};

TEST(LoadPlaces, TheMassIsFoundWhereItIs) {
  const Torques torques(mass * moments_at(centre));
  const auto found = best_place(torques.columns.transpose() * torques.columns, torques.columns.transpose() * torques.y);
  ASSERT_TRUE(found);
  EXPECT_LT((*found - centre).norm(), 0.01);
}

TEST(LoadPlaces, LessThanNothingIsNowhere) {
  MomentsOfLoad less = -mass * moments_at(centre);
  const Torques torques(less);
  EXPECT_FALSE(
      best_place(torques.columns.transpose() * torques.columns, torques.columns.transpose() * torques.y).has_value());
}

}  // namespace
}  // namespace fxdyn::diagnosis
