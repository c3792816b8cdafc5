#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <vector>

namespace fxdyn {

/// Fourier series of one joint with zero velocity and acceleration at the start and the end of every period, and
/// position `centre` there (paper Sec. 3.4, with its boundary conditions met):
///   q(t)   = centre + sum_k a_k / (k w) sin(k w t) - b_k / (k w) cos(k w t)
///   dq(t)  = sum_k a_k cos(k w t) + b_k sin(k w t)
///   ddq(t) = sum_k -a_k k w sin(k w t) + b_k k w cos(k w t),   w = 2 pi / period.
struct FourierJoint {
  double centre = 0;     ///< [rad | m]
  Eigen::VectorXd a, b;  ///< order elements [rad/s | m/s]
};

struct FourierState {
  double q, dq, ddq;
};
FourierState evaluate(const FourierJoint& joint, double period_s, double t);

/// The nearest coefficients (least squares) that meet sum a_k = 0, sum k b_k = 0, sum b_k / k = 0.
void project_onto_boundary_conditions(FourierJoint& joint);

/// All coefficients that meet the boundary conditions: a = null_a z_a, b = null_b z_b for any z. Orthonormal columns,
/// so |z| = |(a, b)|. Order 2 leaves b = 0 (one shape of motion); from order 3 on b has order - 2 directions.
struct FourierNullSpace {
  Eigen::MatrixXd a;  ///< order x (order - 1)
  Eigen::MatrixXd b;  ///< order x (order - 2)
  Eigen::Index size() const { return a.cols() + b.cols(); }
};
FourierNullSpace boundary_null_space(int order);

struct FourierBounds {
  double lower, upper, velocity, acceleration;
};
/// Random coefficients on the boundary conditions, scaled until the tightest of the limits is met at `speed` (0..1]
/// times its value; the centre is random within what the position limits leave.
FourierJoint random_fourier(std::uint64_t seed, int order, double period_s, const FourierBounds& bounds, double speed);

}  // namespace fxdyn
