#include "host_tools/train/sparse_features.hpp"

#include <algorithm>

#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double sparsity = 1e-3;       // of inputs within +-1
constexpr double largest_argument = 2;  // where tanh bends
constexpr double largest_weight = 2;    // times the scale, fixed point's grid still holds it
constexpr int rounds = 1000;
constexpr double penalty = 0.03;  // of the multipliers, against a mean square of about 0.3

VectorXd random_vector(Random& random, Index size) {
  return VectorXd::NullaryExpr(size, [&] { return random.uniform(-1, 1); });
}

}  // namespace

MatrixXd lasso(const MatrixXd& a, const MatrixXd& y, double lambda) {
  const auto n = static_cast<double>(a.rows());
  MatrixXd gram = a.transpose() * a / n;
  gram.diagonal().array() += penalty;
  const Eigen::LLT<MatrixXd> solver(gram);
  const MatrixXd projection = a.transpose() * y / n;
  MatrixXd sparse = MatrixXd::Zero(a.cols(), y.cols()), multiplier = sparse;
  for (int round = 0; round < rounds; ++round) {
    const MatrixXd fit = solver.solve(projection + penalty * (sparse - multiplier));
    const MatrixXd moved = fit + multiplier;
    sparse = moved.array().sign() * (moved.array().abs() - lambda / penalty).max(0);
    multiplier = moved - sparse;
  }
  return sparse;
}

MatrixXd sparse_feature_weights(const MatrixXd& u, Index windows, Index features, Random& random) {
  const Index columns = u.cols() + 1;
  MatrixXd inputs(u.rows(), columns);
  inputs << u, VectorXd::Ones(u.rows());
  MatrixXd weights(columns, windows * features);
  for (Index window = 0; window < windows; ++window) {
    MatrixXd start(columns, features);
    for (Index i = 0; i < features; ++i) start.col(i) = random_vector(random, columns);
    MatrixXd a = inputs * start;
    for (Index i = 0; i < features; ++i) a.col(i) /= std::max(a.col(i).cwiseAbs().maxCoeff(), 1e-12);
    weights.middleCols(window * features, features) = lasso(a, inputs, sparsity).transpose();
  }
  return weights;
}

MatrixXd sparse_weights(const MatrixXd& u, Index nodes, Index windows, Index features, std::uint64_t seed) {
  Random random(seed);
  const Index columns = u.cols() + 1, all = windows * features + 1;
  MatrixXd inputs(u.rows(), columns);
  inputs << u, VectorXd::Ones(u.rows());
  MatrixXd feature_weights = MatrixXd::Zero(columns, all);
  feature_weights.leftCols(all - 1) = sparse_feature_weights(u, windows, features, random);
  feature_weights(columns - 1, all - 1) = 1;

  MatrixXd weights(nodes, columns), group(all, 0);
  for (Index k = 0; k < nodes; ++k) {
    // Gram and Schmidt, twice for the rounding; a full group starts anew.
    if (group.cols() == all) group.resize(all, 0);
    VectorXd column = random_vector(random, all);
    for (int round = 0; round < 2; ++round) column -= group * (group.transpose() * column);
    column.normalize();
    group.conservativeResize(Eigen::NoChange, group.cols() + 1);
    group.rightCols(1) = column;
    const VectorXd w = feature_weights * column;
    const double argument = (inputs * w).cwiseAbs().maxCoeff(), weight = w.cwiseAbs().maxCoeff();
    const double scale =
        std::min(largest_argument / std::max(argument, 1e-12), largest_weight / std::max(weight, 1e-12));
    weights.row(k) = scale * w.transpose();
  }
  return weights;
}

}  // namespace fxdyn
