#include "host_tools/train/ridge.hpp"

#include <algorithm>

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Moments::Moments(Index columns) : gram(MatrixXd::Zero(columns, columns)), projection(VectorXd::Zero(columns)) {}

void Moments::add(const Eigen::Ref<const MatrixXd>& x, const Eigen::Ref<const VectorXd>& y) {
  gram.selfadjointView<Eigen::Lower>().rankUpdate(x.transpose());
  gram.triangularView<Eigen::StrictlyUpper>() = gram.transpose();
  projection.noalias() += x.transpose() * y;
  square += y.squaredNorm();
  rows += static_cast<double>(y.size());
}

double Moments::mean_square(const VectorXd& w) const {
  if (rows == 0) return 0;
  const Index n = w.size();
  const double sum = square - 2 * w.dot(projection.head(n)) + w.dot(gram.topLeftCorner(n, n) * w);
  return std::max(0.0, sum) / rows;
}

}  // namespace fxdyn
