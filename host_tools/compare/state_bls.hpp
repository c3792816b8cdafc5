#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <string>

namespace fxdyn {

/// The paper's Broad Learning System on x = [q, dq, ddq] (Eqs. 22-30), for comparison: it has no memory, so it does not
/// go into firmware.
struct StateBlsShape {
  Eigen::Index windows = 4, nodes = 5;  ///< feature windows m, nodes of each k
  Eigen::Index enhancement = 20;        ///< nodes n l
  double scale = 1;                     ///< of the random weights
  double ridge = 1e-4;                  ///< Eq. 30
  std::string activation = "tanh";      ///< of all nodes: tanh sigmoid relu sine
};

/// What a swarm's particle says: windows, nodes, enhancement, log10 of ridge and scale, activation.
StateBlsShape state_bls_shape(const Eigen::VectorXd& particle);

/// Features of standardised inputs, x within +-1 of the examples.
///   Z_i = phi(x W_i + b_i), H = xi(Z W_h + b_h), A = [Z, H]   (paper Eqs. 23-27)
/// W_i, b_i: sparse autoencoder of the inputs (Chen, Liu 2018, which the paper names for its BLS); W_h, b_h random;
/// phi and xi are the same activation.
class StateBls {
 public:
  StateBls(const StateBlsShape& shape, const Eigen::MatrixXd& examples, std::uint64_t seed);

  /// rows x (m k + n l)
  Eigen::MatrixXd columns(const Eigen::MatrixXd& x) const;
  const StateBlsShape& shape() const { return shape_; }
  Eigen::Index multiplications() const;

 private:
  StateBlsShape shape_;
  Eigen::RowVectorXd mean_, inverse_range_;
  Eigen::MatrixXd feature_, enhancement_;  ///< the last row is the bias
};

}  // namespace fxdyn
