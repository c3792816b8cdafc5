#include "host_tools/compare/state_bls.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "host_tools/support/random.hpp"
#include "host_tools/train/ridge.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd states(Index rows, std::uint64_t seed) {
  Random random(seed);
  return MatrixXd::NullaryExpr(rows, 3, [&] { return random.uniform(-2, 2); });
}

StateBlsShape shape_of(const char* activation) {
  StateBlsShape shape;
  shape.windows = 2;
  shape.nodes = 3;
  shape.enhancement = 7;
  shape.activation = activation;
  return shape;
}

TEST(StateBls, FeaturesAndNodesAreTheActivationOfAffineMaps) {
  const MatrixXd x = states(50, 1);
  const MatrixXd tanh = StateBls(shape_of("tanh"), x, 3).columns(x);
  ASSERT_EQ(tanh.cols(), 2 * 3 + 7);
  // Features (Eq. 23): the argument is affine in x, so its second differences along a line vanish.
  MatrixXd line(3, 3);
  line << 0, 0, 0, 0.1, -0.1, 0.2, 0.2, -0.2, 0.4;
  const MatrixXd z = StateBls(shape_of("tanh"), x, 3).columns(line).leftCols(6).array().atanh();
  EXPECT_LT((z.row(0) - 2 * z.row(1) + z.row(2)).cwiseAbs().maxCoeff(), 1e-12);
  // The same seed draws the same weights, so that the activations of the features can be compared.
  const MatrixXd argument = tanh.leftCols(6).array().atanh();
  const MatrixXd sigmoid = StateBls(shape_of("sigmoid"), x, 3).columns(x),
                 relu = StateBls(shape_of("relu"), x, 3).columns(x), sine = StateBls(shape_of("sine"), x, 3).columns(x);
  for (Index r = 0; r < 50; ++r) {
    for (Index k = 0; k < 6; ++k) {
      const double a = argument(r, k);
      if (std::fabs(a) > 8) continue;  // tanh tells nothing there
      EXPECT_NEAR(sigmoid(r, k), 1 / (1 + std::exp(-a)), 1e-6);
      EXPECT_NEAR(relu(r, k), std::max(0.0, a), 1e-6);
      EXPECT_NEAR(sine(r, k), std::sin(a), 1e-6);
    }
  }
}

/// argmin_w |A w - y|^2 / (2 rows) + lambda sum |w|, one coordinate after the other until none moves.
VectorXd lasso_by_coordinates(const MatrixXd& a, const VectorXd& y, double lambda) {
  const auto rows = static_cast<double>(a.rows());
  VectorXd w = VectorXd::Zero(a.cols()), left = y;
  for (double moved = 1; moved > 1e-13;) {
    moved = 0;
    for (Index k = 0; k < a.cols(); ++k) {
      const double size = a.col(k).squaredNorm() / rows, slope = a.col(k).dot(left) / rows + size * w[k];
      const double next = std::copysign(std::max(std::fabs(slope) - lambda, 0.0), slope) / size;
      left -= (next - w[k]) * a.col(k);
      moved = std::max(moved, std::fabs(next - w[k]));
      w[k] = next;
    }
  }
  return w;
}

TEST(StateBls, ItsFeaturesAreThoseOfTheSparseAutoencoder) {
  // Chen, Liu 2018, which the paper's Eqs. 22-27 stand on: random features A_i of [u, 1], the L1 fit W of [u, 1] by
  // A_i, and the window's features are phi([u, 1] W^T). The random numbers are drawn as the program draws them, all
  // else is written anew.
  const MatrixXd x = states(300, 1);
  const StateBlsShape shape = shape_of("tanh");
  const Eigen::RowVectorXd mean = x.colwise().mean();
  MatrixXd u(x.rows(), 4);
  u << x.rowwise() - mean, VectorXd::Ones(x.rows());
  for (Index c = 0; c < 3; ++c) u.col(c) /= u.col(c).cwiseAbs().maxCoeff();
  Random random(3);
  MatrixXd argument(x.rows(), 6);
  for (Index window = 0; window < shape.windows; ++window) {
    MatrixXd start(4, shape.nodes);
    for (Index i = 0; i < shape.nodes; ++i) {
      for (Index k = 0; k < 4; ++k) start(k, i) = random.uniform(-1, 1);
    }
    MatrixXd a = u * start;
    for (Index i = 0; i < shape.nodes; ++i) a.col(i) /= a.col(i).cwiseAbs().maxCoeff();
    MatrixXd w(shape.nodes, 4);
    for (Index k = 0; k < 4; ++k) w.col(k) = lasso_by_coordinates(a, u.col(k), 1e-3);
    argument.middleCols(window * shape.nodes, shape.nodes) = u * w.transpose();
  }
  const MatrixXd columns = StateBls(shape, x, 3).columns(x);
  EXPECT_LT((columns.leftCols(6) - MatrixXd(argument.array().tanh())).cwiseAbs().maxCoeff(), 1e-6);
  // Eq. 26: the enhancement nodes are the activation of an affine map of all features.
  MatrixXd z(x.rows(), 7);
  z << columns.leftCols(6), VectorXd::Ones(x.rows());
  const MatrixXd h = columns.rightCols(7).array().max(-1 + 1e-9).min(1 - 1e-9).atanh();
  EXPECT_LT((z * z.colPivHouseholderQr().solve(h) - h).norm(), 1e-5 * h.norm());
}

TEST(StateBls, LearnsAFunctionOfTheStateAndNotOneOfThePast) {
  const MatrixXd train = states(2000, 4), test = states(500, 5);
  StateBlsShape shape;
  shape.enhancement = 120;
  const StateBls net(shape, train, 1);
  const auto error_of = [&](auto&& function) {
    Moments moments(net.columns(train).cols());
    moments.add(net.columns(train), function(train));
    GrowingRidge ridge(moments, 1e-6);
    const VectorXd expected = function(test), w = ridge.solve(moments.gram.rows());
    return (net.columns(test) * w - expected).norm() / (expected.array() - expected.mean()).matrix().norm();
  };
  EXPECT_LT(error_of([](const MatrixXd& x) { return VectorXd(x.col(1).array().sin() + 0.2 * x.col(0).array()); }),
            0.05);
  // What the rows before say: nothing of it is in x.
  EXPECT_GT(error_of([](const MatrixXd& x) {
              VectorXd y(x.rows());
              y << 0, x.col(0).head(x.rows() - 1);
              return y;
            }),
            0.9);
}

TEST(StateBls, MultiplicationsAreThoseOfItsMatrices) {
  const MatrixXd x = states(50, 1);
  const StateBls net(shape_of("tanh"), x, 3);
  EXPECT_EQ(net.multiplications(), 3 * 6 + 6 * 7 + 6 + 7);
}

}  // namespace
}  // namespace fxdyn
