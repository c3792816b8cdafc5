#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "host_tools/regression/regressor.hpp"
#include "host_tools/signals/motion.hpp"

namespace fxdyn {

/// The columns that an identification fits, base parameters first: base parameters of the rigid body, then joint by
/// joint viscous and Coulomb friction, offset, and rotor inertia where it is not part of the links'.
class ParameterColumns {
 public:
  /// sign_width: of the Coulomb column tanh(dq / width), one a joint [rad/s | m/s].
  ParameterColumns(const Robot& robot, const Eigen::VectorXd& sign_width);

  Eigen::Index size() const { return static_cast<Eigen::Index>(names_.size()); }
  Eigen::Index base_size() const { return static_cast<Eigen::Index>(base_.columns.size()); }
  /// "hx3", "coulomb 2"
  const std::vector<std::string>& names() const { return names_; }
  /// The link or joint (from 0) that each parameter belongs to.
  const std::vector<Eigen::Index>& joints() const { return joints_; }

  /// Information per second: M = sum_k sum_j phi_j(k)^T phi_j(k) / scale_j^2 * step_s, phi_j(k) the row of joint j at
  /// sample k, p x p. Divided by the sampling interval of a log, with scale = standard deviation of white torque noise,
  /// it is the inverse of the covariance of the least-squares estimate.
  Eigen::MatrixXd information(const Motion& motion, const Eigen::VectorXd& scale) const;

 private:
  DhChain chain_;
  BaseSet base_;
  Eigen::VectorXd sign_width_;
  std::vector<std::string> names_;
  std::vector<Eigen::Index> joints_;
  std::vector<std::vector<std::string>> effects_;    ///< of each joint
  std::vector<std::vector<Eigen::Index>> inertial_;  ///< base columns that joint j's row can differ from zero in
  std::vector<std::vector<Eigen::Index>> own_;       ///< all columns of joint j's row
};

/// Condition number of the column-normalised regressor, sqrt(largest / smallest eigenvalue) of D^-1/2 M D^-1/2 with D
/// the diagonal of the information M. Infinite where M has no full rank.
double scaled_condition(const Eigen::MatrixXd& information);

/// log det M; minus infinity where M has no full rank.
double log_determinant(const Eigen::MatrixXd& information);

/// A parameter that the data determine poorly.
struct WeakParameter {
  std::string name;
  double error = 0;          ///< standard deviation as a share of `size`; infinite where it cannot be identified at all
  bool identifiable = true;  ///< false: a direction that it has part in cannot be identified
  Eigen::Index joint = 0;    ///< the joint to move more (from 0)
};

/// What weak_parameters() needs to know of each column of a regressor.
struct ParameterSizes {
  std::vector<std::string> names;
  std::vector<Eigen::Index> joints;  ///< link or joint that it belongs to, from 0
  std::vector<bool> of_link;         ///< of the rigid body: all joints up to its own move it
  Eigen::VectorXd size;              ///< a change of this size would matter
};

constexpr double weak_error = 0.002;  ///< of a parameter's size: above it the parameter is weak
constexpr double unidentifiable_error =
    0.01;  ///< of a unit direction's size: above it the direction cannot be identified

/// The parameters that cannot be identified, or only poorly, from an information matrix (inverse covariance, p x p) of
/// any regressor. Each column is measured in its size, S = diag(size): eigenvectors of S M S whose standard deviation
/// 1 / sqrt(eigenvalue) is above unidentifiable_error (or whose eigenvalue is rounding) cannot be identified; a
/// parameter with more than a tenth of its weight in them is not identifiable. `movement`: how much each joint moved,
/// as a share of what would be full motion; the joint to move is, of those that move the parameter, the one that moved
/// least. `above`: the error from which on a parameter is returned, 0 for all.
std::vector<WeakParameter> weak_parameters(const Eigen::MatrixXd& information, const ParameterSizes& parameters,
                                           const Eigen::VectorXd& movement, double above = weak_error);

}  // namespace fxdyn
