#pragma once

#include <Eigen/Dense>
#include <memory>
#include <mutex>
#include <vector>

#include "host_tools/regression/dataset.hpp"
#include "host_tools/signals/motion.hpp"

namespace fxdyn::diagnosis {

/// What follows from a log's motion alone, kept for all linearisations: the motion at the log's rate, and rows,
/// filtered and decimated, as they are before whitening.
struct RowCache {
  struct Features {
    Eigen::VectorXd scales;
    Eigen::MatrixXd rows;
  };
  struct AllFeatures {
    Features of_motion, of_model;
  };
  std::once_flag moved;
  std::unique_ptr<const Motion> motion;
  std::unique_ptr<const Motion> slow;  ///< below SessionLog::bending_hz; null: the same
  std::once_flag made;
  std::vector<Eigen::MatrixXd> base;  ///< per joint: its base columns, nothing following in the torque's path
  std::vector<AllFeatures> features;  ///< per joint, see features()
};

/// A log of one of the two sessions. Rows are decimated to `log.decimation`.
struct SessionLog {
  ProcessedLog log;
  bool healthy = false;   ///< of the baseline
  bool fits = true;       ///< else it judges only (validate)
  double age_s = 0;       ///< of the session when the log begins: what drifts has drifted so far
  double bending_hz = 0;  ///< gears bend by the load of the motion below; 0: of all of it
  bool window = false;    ///< of a longer recording (in_windows())
  std::shared_ptr<RowCache> cache = std::make_shared<RowCache>();
};

/// Logs by recording: the windows of one belong together. Places in `logs`.
std::vector<std::vector<std::size_t>> by_recording(const std::vector<SessionLog>& logs);

}  // namespace fxdyn::diagnosis
