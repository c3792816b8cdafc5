#include "host_tools/diagnose/background.hpp"

#include <cmath>

#include "host_tools/regression/solver.hpp"

namespace fxdyn::diagnosis {

using Eigen::MatrixXd;
using Eigen::VectorXd;

Background::Background(MatrixXd functions, const Blocks& blocks, double prior)
    : prior_(prior), b_(std::move(functions)) {
  for (const std::size_t i : blocks.fit) fit_.push_back(blocks.all[i]);
  // Of the size of the noise each at most: friction and base parameters must not hide in it.
  const VectorXd rms =
      (b_.colwise().norm() / std::sqrt(static_cast<double>(b_.rows()))).transpose().array().max(1e-300);
  b_ = b_ * rms.cwiseInverse().asDiagonal();
  MatrixXd gram = MatrixXd::Identity(b_.cols(), b_.cols()) * prior_;
  for (const Block& block : fit_) {
    const auto rows = b_.middleRows(block.first, block.count);
    gram.noalias() += rows.transpose() * rows;
  }
  inverse_ = SymmetricSolver(gram).inverse();
}

MatrixXd Background::eliminate(const MatrixXd& x) const {
  MatrixXd products = MatrixXd::Zero(b_.cols(), x.cols());
  for (const Block& block : fit_)
    products.noalias() += b_.middleRows(block.first, block.count).transpose() * x.middleRows(block.first, block.count);
  const MatrixXd c = inverse_ * products;
  MatrixXd out(x.rows() + c.rows(), x.cols());
  out.topRows(x.rows()) = x - b_ * c;
  out.bottomRows(c.rows()) = -std::sqrt(prior_) * c;
  return out;
}

VectorXd Background::part(const VectorXd& extra_residual) const { return b_ * (extra_residual / std::sqrt(prior_)); }

}  // namespace fxdyn::diagnosis
