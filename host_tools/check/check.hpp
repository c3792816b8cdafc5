#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/check/options.hpp"
#include "host_tools/check/torque_column.hpp"
#include "host_tools/identify/gate_data.hpp"
#include "host_tools/project/project.hpp"

namespace fxdyn {

struct CheckOptions {
  ArrangementOptions arrangement;
  LogFactOptions facts;
};

/// Another explanation of the same that the data can't exclude.
struct OtherFinding {
  std::string kind;                  ///< as that of a finding
  std::optional<std::size_t> joint;  ///< from 0
};

/// Something that is wrong, or may be.
struct CheckFinding {
  bool error = false;                  ///< the data can't be what the project says
  std::string kind;                    ///< "swapped_joints", "rest", ..
  std::optional<std::size_t> joint;    ///< from 0
  std::string log;                     ///< its name; empty: all of them
  std::string text;                    ///< one line: what, and why
  std::string fix;                     ///< the line to write into the project; may be empty
  std::vector<OtherFinding> others{};  ///< the likeliest first
};

/// What a log is, before any fit.
struct LogFacts {
  std::string name;
  Role role = Role::train;
  double begin_s = 0, end_s = 0;  ///< the log's own time
  double seconds = 0, rate_hz = 0;
  bool resampled = false;                    ///< its stamps were irregular
  std::string time_note;                     ///< as Log's
  double rest_share = 0;                     ///< of the time, all joints at rest
  double rest_until_s = 0, rest_from_s = 0;  ///< the log's own time: standstill at its ends
  Eigen::VectorXd q_lower, q_upper;          ///< [rad | m]
  Eigen::VectorXd speed;                     ///< largest [rad/s | m/s]
  Eigen::VectorXd encoder_step;              ///< [rad | m], 0: none is seen
  Eigen::VectorXd largest_torque;            ///< [N*m | N]
};

/// What all logs together show of a joint, before any fit.
struct JointFacts {
  std::string name, unit;                          ///< of its position
  double lower = 0, upper = 0, speed = 0;          ///< [rad | m], [rad/s | m/s]
  std::optional<double> range_share, speed_share;  ///< of the URDF's limits, where it has them
  double encoder_step = 0;                         ///< largest of the logs [rad | m], 0: none is seen
  double largest_torque = 0;                       ///< [N*m | N]
  double saturated_share = 0;                      ///< of the train logs' samples: the drive was at its limit
};

/// What the train logs show together.
struct SignalFacts {
  double excited_hz = 0;  ///< holds 99.9 % of the velocities' energy
  double position_cutoff_hz = 0, torque_cutoff_hz = 0;
  bool position_filtered = true;  ///< false: the cut-off is half of the sampling rate, ZeroPhaseFilter is the identity
  std::optional<MeasuredLead> torque_lead;  ///< see torque_lead(); none: the logs don't tell
};

struct CheckResult {
  std::vector<LogFacts> logs;
  std::vector<JointFacts> joints;
  std::optional<SignalFacts> signals;  ///< none: there is no train log
  std::vector<CheckFinding> findings;
  bool has_error() const;
};

LogFacts facts_of(const Log& log, const LogFactOptions& options);
/// @param train processed; may be empty
std::vector<JointFacts> joints_of(const std::vector<LogFacts>& logs, const Robot& robot,
                                  const std::vector<ProcessedLog>& train);
/// Joints whose torque is at its limit for long.
std::vector<CheckFinding> saturation_of(const std::vector<JointFacts>& joints, const LogFactOptions& options);
/// What each log alone, and all of a role together, show.
std::vector<CheckFinding> findings_of(const std::vector<LogFacts>& logs, const Robot& robot,
                                      const LogFactOptions& options);
/// Columns, signs, zeros, axes, gravity and gains of the train logs against the URDF, see find_mistakes(). Empty where
/// the project does not want it ([check] columns = false).
/// @param others of logs of the same robot whose columns are right; null: there are none. The mistake is one of `logs`
/// alone then: axes and gravity are the robot's, and it has to explain them with the bodies of the others, too
std::vector<CheckFinding> check_columns(const Project& project, const std::vector<ProcessedLog>& logs,
                                        const ArrangementOptions& options = {}, const TorqueSamples* others = nullptr);
/// A log that decides nothing in the fit may have columns of its own. Looked at where it disagrees with the train logs:
/// alone, as it may be of another load, and with the bodies that the train logs teach, as it is of their robot. What it
/// shows less than surely is another load or another day. Empty where the project does not want it.
/// @param train samples of the train logs @param filter theirs
std::vector<CheckFinding> check_one_log(const Project& project, const TorqueSamples& train, Log log,
                                        const FilterFit& filter, const ArrangementOptions& options = {});
/// Facts of the train logs, which are read for them: before those that fit are held, so that a long log is not held
/// twice.
std::vector<LogFacts> facts_of_train_logs(const Project& project, const std::filesystem::path& directory,
                                          const LogFactOptions& options = {});
/// For verbs that go on to a fit: what check() would complain of, as notes. Test logs are looked at, too, but decide
/// nothing.
/// @param train facts of the train logs
/// @throws DataError: the data can't be what the project says, with the line to write
std::vector<std::string> check_before_fit(const Project& project, const std::filesystem::path& directory,
                                          GateData& data, const std::vector<LogFacts>& train,
                                          const CheckOptions& options = {});
/// All of it. Logs of scenarios are made below `directory`.
CheckResult check(const Project& project, const std::filesystem::path& directory, const CheckOptions& options = {});

/// For the terminal: a line a log, one a joint, one on the signals, then the findings with the lines to write.
std::string check_table(const CheckResult& result);
nlohmann::json to_json(const CheckResult& result);

}  // namespace fxdyn
