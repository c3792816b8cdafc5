#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "host_tools/log/log.hpp"
#include "host_tools/log/project.hpp"
#include "host_tools/model/identified_model.hpp"

namespace fxdyn {

/// A log ready for fitting and judging: motion filtered at the position cut-off, torque raw and filtered at the torque
/// cut-off. Every column goes through filter_columns(), so torque and regressor see the same filter.
struct ProcessedLog {
  std::string name;  ///< file name for messages
  Role role = Role::train;
  double from_s = 0, to_s = 0, step_s = 0;
  Eigen::VectorXd t;
  Eigen::MatrixXd q, dq, ddq;        ///< full rate, filtered
  Eigen::MatrixXd tau_raw, tau;      ///< empty without torque
  Eigen::VectorXd q_range, q_noise;  ///< per joint: range of the filtered position, RMS of what its filter took out
  Eigen::Index first = 0, last = 0;  ///< [first, last) is free of filter transients
  Eigen::Index decimation = 1;       ///< rows for fitting: first, first + decimation, ...
  FilterFit filter;

  Eigen::MatrixXd filter_columns(const Eigen::Ref<const Eigen::MatrixXd>& full_rate) const;
  /// The rows that fits use, of a full-rate, filtered matrix.
  Eigen::MatrixXd decimate(const Eigen::Ref<const Eigen::MatrixXd>& filtered) const;
  Eigen::Index rows() const { return first < last ? (last - first - 1) / decimation + 1 : 0; }
};

/// Cut-offs: the project's, else chosen from the logs: ten times the frequency below which 99.9 % of the power of the
/// velocity lies (five times for torque: friction reverses faster than the motion), at most 0.4 of the sampling rate.
/// Motion without noise (simulated, exact) is not filtered.
FilterFit choose_filter(const std::vector<Log>& logs, const SignalSettings& settings);

/// @throws DataError where the log is shorter than the edges that the filter needs.
ProcessedLog process(const Log& log, const FilterFit& filter);

/// RMS of the noise that stays in the filtered torque, estimated from what lies above the cut-off (white noise
/// assumed).
Eigen::VectorXd noise_floor(const ProcessedLog& log);

}  // namespace fxdyn
