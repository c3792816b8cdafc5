#pragma once

#include <Eigen/Dense>
#include <string>

namespace fxdyn {

/// Where an axis of time begins: 0, or the first stamp where six digits don't resolve what follows (seconds since
/// 1970).
double time_origin(const Eigen::VectorXd& t);

/// The axis's label: "time [s]", with the origin where it isn't 0.
std::string time_label(const std::string& axis, double origin);

}  // namespace fxdyn
