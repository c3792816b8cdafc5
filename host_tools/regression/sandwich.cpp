#include "host_tools/regression/sandwich.hpp"

#include <algorithm>

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd middle_of_blocks(const MatrixXd& x, const VectorXd& residual, const std::vector<Index>& ends) {
  const Index p = x.cols();
  MatrixXd middle = MatrixXd::Zero(p, p);
  Index from = 0;
  for (const Index end : ends) {
    const VectorXd sum = x.middleRows(from, end - from).transpose() * residual.segment(from, end - from);
    middle += sum * sum.transpose();
    from = end;
  }
  const double blocks = static_cast<double>(ends.size()), parameters = static_cast<double>(p);
  middle *= blocks / std::max(1.0, blocks - parameters);
  return middle;
}

VectorXd autocovariance(const VectorXd& residual, double faded) {
  std::vector<double> out;
  const Index rows = residual.size();
  for (Index lag = 0; lag < rows / 4; ++lag) {
    const double c = residual.head(rows - lag).dot(residual.tail(rows - lag)) / static_cast<double>(rows);
    if (lag > 0 && c < faded * out.front()) break;
    out.push_back(c);
  }
  return Eigen::Map<const VectorXd>(out.data(), static_cast<Index>(out.size()));
}

MatrixXd middle_of_lags(const MatrixXd& x, const VectorXd& autocovariance) {
  MatrixXd sum = autocovariance[0] * x.transpose() * x;
  for (Index lag = 1; lag < autocovariance.size(); ++lag) {
    const MatrixXd across = autocovariance[lag] * x.topRows(x.rows() - lag).transpose() * x.bottomRows(x.rows() - lag);
    sum += across + across.transpose();
  }
  return sum;
}

MatrixXd sandwich(const MatrixXd& bread, const MatrixXd& middle) { return bread * middle * bread.transpose(); }

}  // namespace fxdyn
