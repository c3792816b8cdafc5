#include "host_tools/regression/pseudo_inertia.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace fxdyn {
namespace {

using Eigen::Matrix4d;
using Eigen::VectorXd;

/// m, m c, second moments: a point of 2 kg at (1, 0, 0) and one of 2 kg all around the origin.
Matrix4d body() {
  Matrix4d p = Matrix4d::Identity();
  p(3, 3) = 4;
  p(0, 3) = p(3, 0) = 2;
  p(0, 0) = 3;
  return p;
}

TEST(PseudoInertia, ParametersAndMatrixAreTheSame) {
  EXPECT_EQ(pseudo_inertia(pseudo_inertia_parameters(body())), body());
  EXPECT_TRUE(pseudo_inertia(from_pseudo_inertia(body())).isApprox(body(), 1e-15));
  EXPECT_EQ(pseudo_inertia_parameters(body())[0], 4);
  EXPECT_EQ(pseudo_inertia_parameters(body())[1], 2);
}

TEST(PseudoInertia, GradientAndHessianOfTheBarrierAreItsDifferences) {
  const VectorXd at = pseudo_inertia_parameters(body());
  const auto barrier = [](const VectorXd& x) { return -std::log(pseudo_inertia(x).determinant()); };
  const VectorXd gradient = -inner_products(body().inverse());
  const Eigen::MatrixXd hessian = barrier_hessian(body().inverse());
  constexpr double h = 1e-5;
  for (Eigen::Index k = 0; k < 10; ++k) {
    const VectorXd step = h * VectorXd::Unit(10, k);
    EXPECT_NEAR((barrier(at + step) - barrier(at - step)) / (2 * h), gradient[k], 1e-8) << k;
    const VectorXd slope = -inner_products(pseudo_inertia(VectorXd(at + step)).inverse()) +
                           inner_products(pseudo_inertia(VectorXd(at - step)).inverse());
    EXPECT_TRUE((slope / (2 * h)).isApprox(hessian.col(k), 1e-6)) << k;
  }
}

}  // namespace
}  // namespace fxdyn
