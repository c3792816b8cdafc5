#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "host_tools/robot/robot.hpp"

namespace fxdyn {

/// The torque regressor Y, n x 10 n, tau = Y pi, pi the standard parameters of model/rigid_body.hpp link by link.
/// Column j is the same link_wrench() as in RNEA with the unit parameter e_j (paper Eq. 7).
class Regressor {
 public:
  explicit Regressor(const DhChain& chain);
  Eigen::Index joints() const { return static_cast<Eigen::Index>(chain_.links.size()); }
  const Eigen::MatrixXd& operator()(const Eigen::VectorXd& q, const Eigen::VectorXd& dq, const Eigen::VectorXd& ddq);

 private:
  DhChain chain_;
  LinkMotion<Real> base_;
  std::vector<LinkMotion<Real>> motions_;
  Eigen::MatrixXd y_;
};

/// A largest set of linearly independent columns of Y over all motions (paper Eqs. 10-11), and how the others depend on
/// them: Y = Y_b (grouping), so beta = grouping * pi, and Y [beta; 0] = Y_b beta.
struct BaseSet {
  std::vector<Eigen::Index> columns;  ///< ascending
  Eigen::MatrixXd grouping;           ///< base x 10 n
};

/// Column-normalised pivoted QR of Y at 60 random motions (fixed seed). Rank: relative 1e-9.
BaseSet find_base(const DhChain& chain);

/// Whether rotor inertia of the joint (ddq in the joint's own row) lies in the span of the base columns, as on the
/// first joints of most arms: then it can't be told from link inertia and has no column of its own.
bool rotor_inertia_is_absorbed(const DhChain& chain, const BaseSet& base, Eigen::Index joint);

/// "m3", "hx3", "Jxy3" for column 10 * (link - 1) + parameter.
std::string parameter_name(Eigen::Index column);

}  // namespace fxdyn
