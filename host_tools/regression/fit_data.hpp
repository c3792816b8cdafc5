#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/regression/dataset.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/regression/split.hpp"

namespace fxdyn {

/// What all fits of the same logs have in common, whatever a joint's effects and BLS: filtered and decimated rows of
/// the rigid body. Rows of all logs are stacked.
struct FitData {
  Robot robot;
  const std::vector<ProcessedLog>* logs = nullptr;
  DhChain chain;
  BaseSet base;
  std::vector<Eigen::Index> first_base;    ///< per joint: base columns from here on act on it
  std::vector<Eigen::Index> first_row;     ///< per log
  std::vector<Eigen::MatrixXd> base_rows;  ///< per joint: rows x base columns that act on it
  std::vector<Eigen::VectorXd> load_rows;  ///< per joint: torque of the logs' known loads [N*m | N]
  std::vector<Eigen::VectorXd> usable;     ///< per joint and row: 0 where saturated, else 1
  std::vector<LogBlock> blocks;
  Split split;
  bool one_recording = false;  ///< its blocks judge one another
};

/// `logs` must outlive the result. `own_parameters`: unknowns beside the base parameters.
/// @throws DataError: a joint that never moves, fewer than two rows a parameter.
FitData make_fit_data(const Robot& robot, const std::vector<ProcessedLog>& logs, Eigen::Index own_parameters);

}  // namespace fxdyn
