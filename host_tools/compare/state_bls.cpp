#include "host_tools/compare/state_bls.hpp"

#include <cmath>

#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

MatrixXd random_matrix(Random& random, Index rows, Index cols, double scale) {
  MatrixXd out(rows, cols);
  for (Index c = 0; c < cols; ++c) {
    for (Index r = 0; r < rows; ++r) out(r, c) = scale * random.uniform(-1, 1);
  }
  return out;
}

MatrixXd affine(const MatrixXd& x, const MatrixXd& weights) {
  return (x * weights.topRows(x.cols())).rowwise() + weights.bottomRows(1).row(0);
}

}  // namespace

StateBls::StateBls(const StateBlsShape& shape, const MatrixXd& examples, std::uint64_t seed) : shape_(shape) {
  mean_ = examples.colwise().mean();
  inverse_std_ = ((examples.rowwise() - mean_).colwise().squaredNorm() / static_cast<double>(examples.rows()))
                     .array()
                     .sqrt()
                     .max(1e-12)
                     .inverse();
  Random random(seed);
  const Index features = shape_.windows * shape_.nodes;
  feature_ = random_matrix(random, examples.cols() + 1, features, 1);
  enhancement_ = random_matrix(random, features + 1, shape_.enhancement,
                               shape_.scale * 3 / std::sqrt(static_cast<double>(features)));
}

MatrixXd StateBls::columns(const MatrixXd& x) const {
  const MatrixXd scaled = (x.rowwise() - mean_).array().rowwise() * inverse_std_.array();
  const MatrixXd z = affine(scaled, feature_);
  MatrixXd h = affine(z, enhancement_);
  if (shape_.activation == "tanh") h = h.array().tanh();
  if (shape_.activation == "sigmoid") h = (1 + (-h.array()).exp()).inverse();
  if (shape_.activation == "relu") h = h.cwiseMax(0);
  if (shape_.activation == "sine") h = h.array().sin();
  MatrixXd out(x.rows(), z.cols() + h.cols());
  out << z, h;
  return out;
}

Index StateBls::multiplications() const {
  // Linear features fold into the enhancement's weights and into one coefficient an input.
  const Index inputs = mean_.size();
  return inputs * shape_.enhancement + shape_.enhancement + inputs;
}

}  // namespace fxdyn
