#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "host_tools/robot/robot.hpp"

namespace fxdyn {

/// The torque regressor Y, n x 10 n, tau = Y pi, pi the standard parameters of model/rigid_body.hpp link by link (paper
/// Eq. 7). One pass outwards: column p of link i is the wrench that link_wrench(), the same code as in RNEA, gives for
/// the unit parameter e_p, and every joint j before the link takes its share of it, tau_j = s_j . moment + l_j . force,
/// with joint j's axis as a screw in the link's frame: direction s_j, l_j = s_j x (from the axis to the frame's
/// origin); for a prismatic joint s_j = 0 and l_j is its direction.
class Regressor {
 public:
  explicit Regressor(const DhChain& chain);
  Eigen::Index joints() const { return static_cast<Eigen::Index>(chain_.links.size()); }
  /// q, dq, ddq: any vectors of n elements; the reference is valid until the next call.
  template <class Q, class Dq, class Ddq>
  const Eigen::MatrixXd& operator()(const Q& q, const Dq& dq, const Ddq& ddq) {
    for (Eigen::Index i = 0; i < joints(); ++i) states_[static_cast<std::size_t>(i)] = {q[i], dq[i], ddq[i]};
    evaluate();
    return y_;
  }

 private:
  struct Screw {
    Vector3<double> direction, moment;
  };
  void evaluate();

  DhChain chain_;
  LinkMotion<Real> base_;
  std::vector<JointState<Real>> states_;
  std::vector<Screw> axes_;  ///< of the joints up to the current link, in its frame
  Eigen::MatrixXd y_;        ///< what belongs to links before a joint stays zero
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
/// first joints of most arms: then it cannot be distinguished from link inertia and has no column of its own.
bool rotor_inertia_is_absorbed(const DhChain& chain, const BaseSet& base, Eigen::Index joint);
/// How it is: ddq = Y_b c, the base parameters of a rotor of 1 kg m^2 (kg). Empty: it is not absorbed.
Eigen::VectorXd rotor_in_base(const DhChain& chain, const BaseSet& base, Eigen::Index joint);

/// "m3", "hx3", "Jxy3" for column 10 * (link - 1) + parameter.
std::string parameter_name(Eigen::Index column);

}  // namespace fxdyn
