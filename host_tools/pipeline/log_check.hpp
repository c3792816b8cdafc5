#pragma once

#include <Eigen/Dense>
#include <filesystem>
#include <string>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn {

/// Thresholds of the look at a log that comes with a model instead of a project. "hand": chosen by hand.
struct LogCheckOptions {
  /// share of a joint's RMS torque; a model that leaves more may have been given other columns; hand: half of
  /// ArrangementOptions::unexplained, as that is a mean over joints
  double unexplained = 0.25;
  /// share of the model's range of position; a motion that goes so far beyond it is told; as LogFactOptions::beyond
  double beyond = 0.05;
};

/// Whether a log can be of the model's robot: where the model does not explain it, columns, signs, zeros and axes are
/// tried as `fxdyn check` does, with the model's bodies in place of the URDF's.
/// @param file the log's
/// @param torque the model's over the log, samples x joints [N*m | N]; not filtered
/// @return what a reader should know: motion outside of what the model was made for
/// @throws DataError: other columns, signs or zeros explain the log far better
std::vector<std::string> check_log_for(const IdentifiedModel& model, const std::filesystem::path& file,
                                       const ProcessedLog& log, const Eigen::MatrixXd& torque,
                                       const LogCheckOptions& options = {});

}  // namespace fxdyn
