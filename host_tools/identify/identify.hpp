#pragma once

#include <memory>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/identify/excitation.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/regression/fitter.hpp"
#include "host_tools/regression/physical.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {

/// The logs that decide: train and validate, filtered; test is not read here.
struct GateData {
  FilterFit filter;
  std::vector<ProcessedLog> logs;
  std::vector<LogReference> references;
  std::vector<std::string> notes;             ///< what a reader should know of the data
  Eigen::VectorXd largest_torque;             ///< raw, over the train and validate logs [N*m | N]
  Eigen::VectorXd q_lower, q_upper, dq, ddq;  ///< largest of the filtered motion
};
/// @throws InputError where the project names no train log.
GateData read_gate_data(const Project& project, const std::filesystem::path& directory);

/// @throws DataError: a torque column that never changes, of a joint that moves
void check_torque(const Log& log, const Robot& robot);

/// Limits and ratings of each joint: the project's, else 1.2 times the largest in the logs; URDF limits where the logs
/// come within a factor of ten of them.
std::vector<JointFit> initial_joints(const Project& project, const GateData& data);

/// Weights of joints and rows by the project's method.
void weigh(Fitter& fitter, const IdentifySettings& settings);

/// Structure and friction: widths and shapes searched on the gate data, coefficients by (weighted) least squares.
/// Returns the fitter with the chosen designs. What it leaves out for want of data goes into data.notes.
std::unique_ptr<Fitter> identify(const Project& project, GateData& data, Progress& progress);

/// Of the project file and its URDF.
std::string project_hash(const Project& project);

/// What a fitter's fit comes to.
struct Estimate {
  IdentifiedModel model;  ///< with everything that model.json records
  /// The physically possible fit, where the project asks for it; the model has its base parameters unless the project
  /// asks for the essential ones.
  std::optional<PhysicalFit> physical;
  std::vector<WeakParameter> weak;             ///< see weak_in_logs()
  double condition = 0;                        ///< of the column-normalised weighted regressor, base and own columns
  std::optional<Fitter::Recursion> recursion;  ///< method rls
};
/// @throws DataError: the train logs tell nothing of some base parameters; names them and the joint to move.
Estimate finish_model(const Fitter& fitter, const Project& project, const GateData& data);

}  // namespace fxdyn
