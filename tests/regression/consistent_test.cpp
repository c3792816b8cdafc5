#include "host_tools/regression/consistent.hpp"

#include <gtest/gtest.h>

#include "host_tools/regression/pseudo_inertia.hpp"

namespace fxdyn {
namespace {

/// One body of which the data know mass and one coefficient beside it, with one row's weight of `information`.
ConsistentProblem problem(double mass, double coefficient, double information) {
  ConsistentProblem out;
  out.information = information * Eigen::Matrix2d::Identity();
  out.projection = information * Eigen::Vector2d(mass, coefficient);
  out.lower = Eigen::VectorXd::Zero(1);
  out.upper = Eigen::VectorXd::Constant(1, 1e30);
  out.grouping = Eigen::MatrixXd::Zero(1, 10);
  out.grouping(0, 0) = 1;
  out.columns = {0};
  out.prior = {Eigen::Matrix4d::Identity()};
  return out;
}

TEST(Consistent, WhatSomeBodyExplainsIsTheResult) {
  const ConsistentFit fit = fit_consistent(problem(3, 0.5, 1e6));
  EXPECT_FALSE(fit.constrained);
  EXPECT_DOUBLE_EQ(fit.beta[0], 3);
  EXPECT_DOUBLE_EQ(fit.theta[0], 0.5);
  EXPECT_NEAR(fit.bodies[0](3, 3), 3, 1e-9);
}

TEST(Consistent, ANegativeMassBecomesASmallOne) {
  const ConsistentFit fit = fit_consistent(problem(-1, 0.5, 1e6));
  EXPECT_TRUE(fit.constrained);
  EXPECT_GT(fit.beta[0], 0);
  EXPECT_LT(fit.beta[0], 1e-3);
}

TEST(Consistent, ACoefficientStaysInItsBounds) {
  const ConsistentFit fit = fit_consistent(problem(3, -0.5, 1e6));
  EXPECT_TRUE(fit.constrained);
  EXPECT_GE(fit.theta[0], 0);
  EXPECT_LT(fit.theta[0], 1e-3);
  EXPECT_NEAR(fit.beta[0], 3, 1e-3);
}

}  // namespace
}  // namespace fxdyn
