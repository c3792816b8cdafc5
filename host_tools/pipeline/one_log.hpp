#pragma once

#include <Eigen/Dense>
#include <filesystem>
#include <optional>
#include <string>

#include "host_tools/effects/forward.hpp"
#include "host_tools/logs/log.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn {

/// A log that the project need not name, or a window of it, with the columns and gains that the model knows.
/// @throws InputError also where the project's logs differ in them
Log read_log_for(const IdentifiedModel& model, const std::filesystem::path& file, std::optional<double> from_s,
                 std::optional<double> to_s, bool torque_required = true);

/// Ends with the cause where the log can't be of the model's robot; see check_log_for(). Notes go to the terminal.
/// @throws DataError
void require_log_of(const IdentifiedModel& model, const std::filesystem::path& file, const ProcessedLog& log,
                    const Eigen::MatrixXd& torque);

struct Prediction {
  bool fixed = false;       ///< as the firmware computes, else in double
  bool raw = false;         ///< as computed; else below the torque's cut-off, which the fit saw: above it is noise of q
  bool trajectory = false;  ///< and the motion with its feedforward for ros2_control (joint_trajectory.hpp)
};

/// Name of the file with the prediction of a log: CSV, whatever the log is and is packed in. Of a log that is a folder
/// it is the folder's.
std::filesystem::path prediction_name(const std::filesystem::path& log);

/// `fxdyn predict`: torque of the model over one log, in DIR/prediction_name(); the errors as a table for people. A
/// trajectory is DIR/<that name>.yaml: the filtered motion, and the torque at its own times.
std::string predict_log(const std::filesystem::path& model, const std::filesystem::path& log, const Prediction& how,
                        const std::filesystem::path& directory);

/// `fxdyn payload`: the load of a second log, payload.json and the model with it, model.json; its figures as a table.
std::string identify_payload(const std::filesystem::path& model, const std::filesystem::path& log,
                             const std::filesystem::path& directory);

/// The same with a load that is known: gains of the joints' torques from a log without it and one with it, payload.json
/// and torque_gain.toml, the line for the project; as a table.
std::string identify_torque_gains(const std::filesystem::path& model, const std::filesystem::path& unloaded,
                                  const std::filesystem::path& loaded, const Load& load,
                                  const std::filesystem::path& directory);

}  // namespace fxdyn
