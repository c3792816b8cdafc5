#pragma once

#include <Eigen/Dense>
#include <string_view>
#include <vector>

#include "host_tools/diagnose/options.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/forward.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn::diagnosis {

/// A log with a link encoder, and the rigid body's torque over it, samples x joints [N*m | N].
struct LinkedLog {
  const ProcessedLog* log;
  const Eigen::MatrixXd* load;
};

/// The torque of the rigid body over each log that has a link encoder, all joints.
std::vector<Eigen::MatrixXd> rigid_loads(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs);

/// How the load follows from base parameters that are uncertain, Y_j L with covariance = L L^T: along the directions in
/// which the load itself is uncertain by more than a share of it.
struct LoadUncertainty {
  Eigen::MatrixXd spread;  ///< of base parameters [columns x directions]
  std::vector<Eigen::Index> columns;
  double rotor = 0;  ///< one more direction: so much of the inertia is a rotor's, a priori; 0: none is hidden
};

/// Which rows of a log: `all`, or two a period of the filter's cut-off. Above it there is next to nothing in the rows
/// but the load's own noise, from differentiated positions. Rows that are closer let the autoregression see that band,
/// and whitening makes it count as much as the motion: coefficients then seem surer than they are.
enum class Rows { all, independent };

/// q - qlink of one joint, filtered and decimated, and the columns of effects that may explain it.
class DeflectionRows {
 public:
  DeflectionRows(const IdentifiedModel& model, const std::vector<LinkedLog>& logs, std::size_t joint,
                 Rows rows = Rows::all);

  std::size_t joint() const { return joint_; }
  std::size_t logs() const { return logs_.size(); }
  const Eigen::VectorXd& delta() const { return delta_; }
  Eigen::MatrixXd columns(std::string_view effect, const std::vector<double>& shape) const;
  /// One column a log: encoders are mounted anywhere.
  Eigen::MatrixXd offsets() const;
  Eigen::MatrixXd whiten(const Eigen::MatrixXd& x, const Eigen::VectorXd& coefficients) const;
  /// Coefficients of the autoregression that a residual follows.
  Eigen::VectorXd colour(const Eigen::VectorXd& residual) const;
  double largest_load() const;

  /// Directions in which the load is uncertain; the rows get its slopes along them, and z = 0.
  LoadUncertainty add_uncertainty(const IdentifiedModel& model, const Eigen::MatrixXd& base_covariance,
                                  const DeflectionOptions& options, bool with_rotor);
  /// .. of other rows of the same joint.
  void add_slopes(const IdentifiedModel& model, const LoadUncertainty& uncertainty);
  void drop_slopes();
  /// Where the base parameters are along the directions, in units of their standard deviations: a priori 0, 1. Empty:
  /// the load is taken as it is.
  const Eigen::VectorXd& z() const { return z_; }
  /// The load with the base parameters elsewhere.
  void move(const Eigen::VectorXd& z);
  /// d load / d z and the load, filtered and decimated.
  Eigen::MatrixXd slope_rows() const;
  Eigen::VectorXd load_rows() const;

 private:
  Eigen::MatrixXd slopes_of(std::size_t log, const IdentifiedModel& model, const LoadUncertainty& uncertainty) const;
  Eigen::MatrixXd kept(std::size_t log, const Eigen::MatrixXd& full) const;
  double half_of_hidden_rotor(const IdentifiedModel& model) const;

  std::size_t joint_;
  double width_;  ///< of the sign
  std::vector<const ProcessedLog*> logs_;
  std::vector<JointSeries> series_;
  std::vector<Eigen::Index> first_, count_, stride_;
  Eigen::VectorXd delta_;
  std::vector<Eigen::MatrixXd> slopes_;  ///< d load / d z by log, at full rate
  Eigen::VectorXd z_;
};

/// y less its least squares fit by the columns of x.
Eigen::VectorXd residual(const Eigen::MatrixXd& x, const Eigen::VectorXd& y);

}  // namespace fxdyn::diagnosis
