#pragma once

#include <Eigen/Dense>
#include <optional>

#include "host_tools/diagnose/log_columns.hpp"

namespace fxdyn::diagnosis {

/// Numbers that a body has: mass, first and second moment. A point mass m at c has m [1, c, c c^T].
inline constexpr Eigen::Index moments_of_load = 10;
using MomentsOfLoad = Eigen::Matrix<double, moments_of_load, 1>;

/// 1, x, y, z, xx, yy, zz, xy, xz, yz of the place c of a mass of 1 kg [m].
MomentsOfLoad moments_at(const Eigen::Vector3d& c);
/// Around a mass at c: what of the moments a change of the mass (its first moment kept), and of the first moment,
/// gives.
Eigen::Matrix<double, moments_of_load, 4> moments_around(const Eigen::Vector3d& c);

/// Point masses at ten places of the last link, 1 m from its origin or there: their torques make those of any body.
class PointLoads {
 public:
  PointLoads(const LogColumns& columns, std::size_t log);
  /// At full rate, samples x joints [N*m | N per kg].
  Eigen::MatrixXd torque(Eigen::Index place) const;

 private:
  const LogColumns& columns_;
  std::size_t log_;
  Eigen::MatrixXd without_;
};
/// Torques by moment = torques by place * this.
const Eigen::Matrix<double, moments_of_load, moments_of_load>& moments_from_places();

/// The point mass whose torque explains most: of 2 p^T theta - theta^T G theta, theta = m moments_at(c), by
/// Levenberg-Marquardt from the body of any shape that does. @returns where it is; nothing where its mass is none
std::optional<Eigen::Vector3d> best_place(const Eigen::MatrixXd& gram, const Eigen::VectorXd& projection);

}  // namespace fxdyn::diagnosis
