#pragma once

#include <Eigen/Dense>
#include <string>

namespace fxdyn {

/// A motion on a uniform time grid: t [s], and q, dq, ddq as samples x joints [rad | m, and per s, per s^2].
struct Motion {
  std::string name;
  double step_s;
  Eigen::VectorXd t;
  Eigen::MatrixXd q, dq, ddq;
};

}  // namespace fxdyn
