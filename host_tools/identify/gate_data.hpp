#pragma once

#include <Eigen/Dense>
#include <filesystem>
#include <string>
#include <vector>

#include "host_tools/effects/filter_fit.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/effects/log_reference.hpp"
#include "host_tools/identify/options.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/simulate/known_rows.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {

/// The logs that decide: train and validate, filtered; test is not read here.
struct GateData {
  FilterFit filter;
  std::vector<ProcessedLog> logs;
  std::vector<LogReference> references;
  KnownRows rows;                             ///< of these logs, for what is read after them
  std::vector<std::string> notes;             ///< what a reader should know of the data
  Eigen::VectorXd largest_torque;             ///< raw, over the train and validate logs [N*m | N]
  Eigen::VectorXd q_lower, q_upper, dq, ddq;  ///< largest of the filtered motion
  /// So many may work on them: each thread takes memory for columns of its own.
  std::size_t threads = threads_allowed();
};
/// @throws InputError where the project names no train log.
GateData read_gate_data(const Project& project, const std::filesystem::path& directory,
                        const GateOptions& options = {});

/// @throws DataError: a torque column that never changes, of a joint that moves
void check_torque(const Log& log, const Robot& robot, const GateOptions& options = {});

/// Limits and ratings of each joint: the project's, else 1.2 times the largest in the logs; URDF limits where the logs
/// come within a factor of ten of them.
std::vector<JointFit> initial_joints(const Project& project, const GateData& data, const GateOptions& options = {});

}  // namespace fxdyn
