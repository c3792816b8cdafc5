#pragma once

#include <Eigen/Dense>

namespace fxdyn {

/// Samples y over x in classes of equally many samples.
struct ClassMeans {
  Eigen::VectorXd x, y, spread;  ///< means of the classes; standard deviation of y within each
  double explained = 0;          ///< share of y's variance that lies between the classes: 1 if y is a function of x
};
/// Samples with NaN in x or y don't count; fewer samples than classes: a class each.
ClassMeans class_means(const Eigen::VectorXd& x, const Eigen::VectorXd& y, Eigen::Index classes = 80);

}  // namespace fxdyn
