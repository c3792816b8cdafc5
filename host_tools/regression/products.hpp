#pragma once

#include <Eigen/Dense>

namespace fxdyn {

/// Sums of products over rows: all that least squares needs of the columns that a candidate brings along.
struct JointMoments {
  Eigen::MatrixXd cross, gram;  ///< base x own, own x own
  Eigen::VectorXd projection;
};

/// base^T W own, own^T W own, own^T W torque; W = diag(weights). Summed row by row, so the same to the bit on every
/// processor.
JointMoments weighted_products(const Eigen::Ref<const Eigen::MatrixXd>& base,
                               const Eigen::Ref<const Eigen::MatrixXd>& own,
                               const Eigen::Ref<const Eigen::VectorXd>& weights,
                               const Eigen::Ref<const Eigen::VectorXd>& torque);

}  // namespace fxdyn
