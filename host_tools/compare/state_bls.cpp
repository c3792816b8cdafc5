#include "host_tools/compare/state_bls.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "host_tools/support/random.hpp"
#include "host_tools/train/sparse_features.hpp"

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

MatrixXd activated(const MatrixXd& x, const std::string& activation) {
  if (activation == "tanh") return x.array().tanh();
  if (activation == "sigmoid") return (1 + (-x.array()).exp()).inverse();
  if (activation == "relu") return x.cwiseMax(0);
  return x.array().sin();
}

}  // namespace

StateBlsShape state_bls_shape(const Eigen::VectorXd& particle) {
  static const std::array<const char*, 4> activations{"tanh", "sigmoid", "relu", "sine"};
  StateBlsShape shape;
  shape.windows = std::lround(particle[0]);
  shape.nodes = std::lround(particle[1]);
  shape.enhancement = std::lround(particle[2]);
  shape.ridge = std::pow(10, particle[3]);
  shape.scale = std::pow(10, particle[4]);
  shape.activation = activations[static_cast<std::size_t>(std::clamp(std::floor(particle[5]), 0.0, 3.0))];
  return shape;
}

StateBls::StateBls(const StateBlsShape& shape, const MatrixXd& examples, std::uint64_t seed) : shape_(shape) {
  mean_ = examples.colwise().mean();
  const MatrixXd centred = examples.rowwise() - mean_;
  inverse_range_ = centred.cwiseAbs().colwise().maxCoeff().array().max(1e-12).inverse();
  Random random(seed);
  const Index features = shape_.windows * shape_.nodes;
  feature_ =
      sparse_feature_weights(centred.array().rowwise() * inverse_range_.array(), shape_.windows, shape_.nodes, random);
  enhancement_ = random_matrix(random, features + 1, shape_.enhancement,
                               shape_.scale * 3 / std::sqrt(static_cast<double>(features)));
}

MatrixXd StateBls::columns(const MatrixXd& x) const {
  const MatrixXd scaled = (x.rowwise() - mean_).array().rowwise() * inverse_range_.array();
  const MatrixXd z = activated(affine(scaled, feature_), shape_.activation);
  const MatrixXd h = activated(affine(z, enhancement_), shape_.activation);
  MatrixXd out(x.rows(), z.cols() + h.cols());
  out << z, h;
  return out;
}

Index StateBls::multiplications() const {
  const Index features = shape_.windows * shape_.nodes;
  return mean_.size() * features + features * shape_.enhancement + features + shape_.enhancement;
}

}  // namespace fxdyn
