#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/report/diagnosis_result.hpp"

namespace fxdyn::fleet {

/// An effect that the diagnosis named, without what only the robot's own report shows.
struct FoundEffect {
  std::string effect;
  bool established = false;
  double odds = 0;  ///< log10, against nothing, on data that did not fit it
  std::vector<NamedParameter> parameters;
};

struct JointState {
  std::string joint, unit;
  std::optional<Verdict> verdict;  ///< none: the verb does not diagnose
  std::optional<double> error;     ///< RMSE over RMS of the torque on the logs of `judged_on`
  std::vector<FoundEffect> effects;
  std::optional<double> lack_log10_p{};  ///< log10 of p that nothing is left; none: not tested
};

/// Content of robots/ID/result.json: what the fleet's page needs of a robot.
struct RobotState {
  std::string robot;      ///< name in its URDF
  std::string judged_on;  ///< test, validate or train
  bool baseline = false;  ///< a healthy session took part: what is found changed since then
  std::optional<Verdict> verdict;
  std::vector<JointState> joints;
  std::vector<FoundEffect> on_robot;  ///< effects of no single joint
  std::vector<std::string> notes;     ///< of the diagnosis
  std::vector<std::string> files;     ///< that a reader may open, in robots/ID
};
nlohmann::json to_json(const RobotState& state);
RobotState robot_state_of(const nlohmann::json& file);

/// From what the robot's program wrote into FOLDER/out.
/// @throws InputError: results are missing
RobotState read_results_of(const std::filesystem::path& folder);

}  // namespace fxdyn::fleet
