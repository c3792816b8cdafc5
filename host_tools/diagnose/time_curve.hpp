#pragma once

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host_tools/diagnose/features.hpp"
#include "host_tools/diagnose/linearised.hpp"
#include "host_tools/report/diagnosis_result.hpp"

namespace fxdyn::diagnosis {

/// Rows of a joint that a curve over time is fitted to.
struct TimedRows {
  Eigen::VectorXd t;       ///< of the session's clock [s]
  Eigen::VectorXd e;       ///< what the model leaves [N*m | N]
  Eigen::VectorXd sign;    ///< tanh(dq / width), as Coulomb friction has it
  Eigen::MatrixXd rivals;  ///< functions of the state as the nominal fit leaves them: may they explain it as well
  std::vector<Family> families{};     ///< of them
  Eigen::MatrixXd nominal{};          ///< columns that were fitted before: they have taken some of a curve, too
  Eigen::MatrixXd covariance{};       ///< .. of their coefficients, over the variance of the noise
  std::vector<Eigen::Index> place{};  ///< of each among the rows of the problem
};

/// A curve over time: its knots, heights, and how sure it is.
struct TimeFit {
  double from = 0, knot_s = 0;  ///< the first knot, and from one to the next [s]
  bool friction = false;        ///< times the direction
  Eigen::VectorXd heights;      ///< [N*m | N]
  Eigen::MatrixXd covariance;   ///< of them
  double odds_nothing = 0;      ///< log10, on stretches that did not fit it
  double closes = 0;            ///< share of the error's power that it takes away there
  double closes_std = 0;        ///< .. by how these stretches differ
  double misfit = 0;            ///< variance of what it can't follow
  double square_of_rivals = 0;  ///< what functions of the state leave there, of what was there
};

/// What is left at a joint as a cubic B-spline (model/effects/curve.hpp) of the session's time, or of its time times
/// the direction: a torque that comes and goes by itself. Knots are as near as the data ask for: the distance is a
/// ninth of the session, or half of that, and so on, and each is judged by fits that leave out every fifth stretch in
/// turn (CurveOptions). Rows whose errors are correlated count as one, and the number of curves tried is taken off the
/// odds.
/// @param size standard deviation of the heights beforehand @param row_s from one row to the next [s]
/// @returns the best; none where there are too few rows
std::optional<TimeFit> fit_over_time(const TimedRows& rows, double size, double row_s, const CurveOptions& options);

/// Heights' factors at times, times x heights.
Eigen::MatrixXd bumps_over_time(const TimeFit& fit, const Eigen::VectorXd& t);

/// Curves of what is left over time, for the session alone: no drive knows the time at which a pump starts.
class TimeCurves {
 public:
  /// @param problem with what was found, not whitened; has to live as long
  explicit TimeCurves(const Linearised& problem);
  /// Those of a joint, the surest first: one of the session, or of each recording where they share no clock. None that
  /// is not sure, of which functions of the state leave less, or where the healthy session's residual wanders as much.
  /// Safe from several threads.
  std::vector<CurveResult> at(std::size_t joint) const;

 private:
  std::optional<CurveResult> over(const std::vector<std::size_t>& clock, std::size_t joint,
                                  const TimedRows& rows) const;
  TimedRows rows_of(const std::vector<std::size_t>& logs, std::size_t joint, const Eigen::MatrixXd& state) const;
  /// What was fitted before, of the joint: columns of all rows, and their covariance over the noise's variance.
  std::pair<Eigen::MatrixXd, Eigen::MatrixXd> nominal_of(std::size_t joint) const;

  const Linearised& problem_;
  LinearFit fit_;
  Eigen::MatrixXd covariance_;                    ///< of its coefficients
  std::vector<std::vector<std::size_t>> clocks_;  ///< today's logs that share one
  std::vector<std::size_t> healthy_;              ///< windows of the healthy session's longest recording
};

/// Takes a curve over time off the torque of the logs that it is of.
/// @param sign_width of the joint's Coulomb friction [rad/s | m/s]
void take_off(const CurveResult& curve, std::size_t joint, double sign_width, std::vector<SessionLog>& logs);

}  // namespace fxdyn::diagnosis
