#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/check/options.hpp"
#include "host_tools/identify/gate_data.hpp"
#include "host_tools/project/project.hpp"

namespace fxdyn {

struct CheckOptions {
  ArrangementOptions arrangement;
  LogFactOptions facts;
};

/// Something that is wrong, or may be.
struct CheckFinding {
  bool error = false;                ///< the data can't be what the project says
  std::string kind;                  ///< "swapped_joints", "rest", ..
  std::optional<std::size_t> joint;  ///< from 0
  std::string log;                   ///< its name; empty: all of them
  std::string text;                  ///< one line: what, and why
  std::string fix;                   ///< the line to write into the project; may be empty
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

struct CheckResult {
  std::vector<LogFacts> logs;
  std::vector<CheckFinding> findings;
  bool has_error() const;
};

LogFacts facts_of(const Log& log, const LogFactOptions& options);
/// What each log alone, and all of a role together, show.
std::vector<CheckFinding> findings_of(const std::vector<LogFacts>& logs, const Robot& robot,
                                      const LogFactOptions& options);
/// Columns, signs, zeros, axes, gravity and gains of the train logs against the URDF, see find_mistakes(). Empty where
/// the project does not want it ([check] columns = false).
std::vector<CheckFinding> check_columns(const Project& project, const std::vector<ProcessedLog>& logs,
                                        const ArrangementOptions& options = {});
/// All of it. Logs of scenarios are made below `directory`.
CheckResult check(const Project& project, const std::filesystem::path& directory, const CheckOptions& options = {});

/// For the terminal: a line a log, then the findings with the lines to write.
std::string check_table(const CheckResult& result);
nlohmann::json to_json(const CheckResult& result);

}  // namespace fxdyn
