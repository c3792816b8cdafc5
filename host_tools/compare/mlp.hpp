#pragma once

#include <Eigen/Dense>
#include <cstdint>

namespace fxdyn {

/// What a network is trained on: inputs and target, row by row.
struct Examples {
  Eigen::MatrixXd x;  ///< rows x inputs
  Eigen::VectorXd y;
};

/// A multilayer perceptron with one hidden layer, the comparison's (paper Table 2):
///   y = c . tanh(W x' + b) + d,   x' the inputs with mean 0 and variance 1 on the training rows
/// Trained by L-BFGS on the mean square error with a weight decay of 1e-6; the weights kept are those of the least
/// error on the rows that judge (early stopping), from the best of `starts` random starts.
class Mlp {
 public:
  Mlp(const Examples& train, const Examples& judge, Eigen::Index hidden, std::uint64_t seed, int starts = 2,
      int iterations = 400);

  Eigen::VectorXd operator()(const Eigen::MatrixXd& x) const;
  /// Multiplications of one evaluation.
  Eigen::Index multiplications() const { return hidden_ * (mean_.size() + 1); }
  double judged() const { return judged_; }  ///< mean square error where it was stopped
  /// What training minimises, at weights w (in the order of w_) on scaled rows, and its gradient.
  double loss(const Eigen::VectorXd& w, const Eigen::MatrixXd& x, const Eigen::VectorXd& y,
              Eigen::VectorXd& gradient) const;

 private:
  Eigen::MatrixXd scaled(const Eigen::MatrixXd& x) const;
  /// Hidden activations of scaled inputs.
  Eigen::MatrixXd hidden(const Eigen::VectorXd& w, const Eigen::MatrixXd& x) const;
  Eigen::VectorXd evaluate(const Eigen::VectorXd& w, const Eigen::MatrixXd& x) const;

  Eigen::Index hidden_;
  Eigen::RowVectorXd mean_, inverse_std_;
  double y_mean_ = 0, y_std_ = 1;
  Eigen::VectorXd w_;  ///< W by rows of x' then b [hidden x (inputs + 1)], c, d
  double judged_ = 0;
};

}  // namespace fxdyn
