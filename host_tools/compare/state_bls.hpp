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
  std::string activation = "tanh";      ///< of the enhancement nodes: tanh sigmoid relu sine
};

/// Random features of standardised inputs.
///   Z_i = x W_i + b_i (linear, as in Chen, Liu 2018), H = xi(Z W_h + b_h), A = [Z, H]
class StateBls {
 public:
  StateBls(const StateBlsShape& shape, const Eigen::MatrixXd& examples, std::uint64_t seed);

  /// rows x (m k + n l)
  Eigen::MatrixXd columns(const Eigen::MatrixXd& x) const;
  const StateBlsShape& shape() const { return shape_; }
  Eigen::Index multiplications() const;

 private:
  StateBlsShape shape_;
  Eigen::RowVectorXd mean_, inverse_std_;
  Eigen::MatrixXd feature_, enhancement_;  ///< the last row is the bias
};

}  // namespace fxdyn
