#include "host_tools/simulate/recordings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <numbers>

#include "host_tools/project/log_entries.hpp"
#include "host_tools/project/provenance.hpp"
#include "host_tools/signals/same_motion.hpp"
#include "host_tools/simulate/simulate.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

/// Whether a scenario's log was made from what the scenario says now. Of the scenario and its URDF, not the time
/// stamps: a checkout or a copy changes those.
bool is_simulated(const LogEntry& entry, const fs::path& directory) {
  const fs::path file = log_file(entry, directory), hash_file = file.parent_path() / "scenario.hash";
  return fs::exists(file) && fs::exists(hash_file) && read_file(hash_file) == scenario_hash(*entry.scenario);
}

/// The log of a scenario; simulated where it is missing or older than the scenario.
fs::path simulated(const LogEntry& entry, const Project& project, const fs::path& directory) {
  const fs::path file = log_file(entry, directory), folder = file.parent_path();
  if (!is_simulated(entry, directory)) {
    simulate(*entry.scenario, folder);
    write_file(folder / "scenario.hash", scenario_hash(*entry.scenario));
  }
  if (!fs::exists(file)) {
    throw InputError(fmt::format("{}:{}: scenario {} has no log '{}'", project.file.string(), entry.line,
                                 entry.scenario->string(), entry.scenario_log));
  }
  return file;
}

/// Another name for the same data would let it judge what it has fitted: two logs of a scenario with the same seed and
/// settings, or a scenario's log and a CSV that was made from it. Those that are not simulated yet come later.
void check_copies(const Project& project, const fs::path& directory) {
  const auto is_known = [&](const LogEntry& entry) { return !entry.scenario || is_simulated(entry, directory); };
  for (std::size_t i = 0; i < project.logs.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const LogEntry &a = project.logs[j], &b = project.logs[i];
      const fs::path of_a = log_file(a, directory), of_b = log_file(b, directory);
      const bool files = !a.scenario && !b.scenario, windows = a.scenario && b.scenario && of_a == of_b;
      if (files || windows || !share_time(a, b) || !same_content(of_a, of_b)) continue;
      if (is_known(a) && is_known(b)) throw overlap(project, a, b, same_bytes);
    }
  }
}

/// Prints of the logs that this process has read for a project: what judges is read after what is fitted.
class ReadLogs {
 public:
  /// @throws InputError: the log holds rows of one with another role, under other time stamps
  void check(const Project& project, const LogEntry& entry, const Log& log) {
    constexpr std::size_t fewest = 50;     // rows that are no coincidence
    constexpr double share_of_copy = 0.1;  // of the shorter log's rows
    std::vector<std::uint64_t> prints = row_prints(log);
    const std::lock_guard lock(reading_);
    std::map<int, std::vector<std::uint64_t>>& known = prints_[project_hash(project)];
    for (const LogEntry& other : project.logs) {
      const auto found = known.find(other.line);
      if (found == known.end() || other.role == entry.role || is_source(other, entry)) continue;
      const std::size_t common = rows_in_common(found->second, prints);
      const std::size_t shorter = std::min(found->second.size(), prints.size());
      if (common < fewest || static_cast<double>(common) < share_of_copy * static_cast<double>(shorter)) continue;
      throw InputError(
          fmt::format("{}:{}: {} of its {} moving rows are those of the log in line {}, under other time "
                      "stamps: a copy can't judge what was fitted on it; record another motion",
                      project.file.string(), entry.line, common, prints.size(), other.line));
    }
    known[entry.line] = std::move(prints);
  }

 private:
  /// Windows of one log are told apart by their times.
  static bool is_source(const LogEntry& a, const LogEntry& b) {
    return a.file == b.file && a.scenario == b.scenario && a.scenario_log == b.scenario_log;
  }
  std::map<std::string, std::map<int, std::vector<std::uint64_t>>> prints_;  ///< project's hash, line of the [[log]]
  std::mutex reading_;
};

/// A joint with end stops can't turn far beyond them.
void check_turns(const Log& log, const Robot& robot) {
  for (std::size_t i = 0; i < robot.size(); ++i) {
    const Joint& joint = robot.joints[i];
    if (joint.type != JointType::revolute || joint.continuous || !joint.limits) continue;
    const auto q = log.q.col(static_cast<Eigen::Index>(i));
    const double range = q.maxCoeff() - q.minCoeff(), allowed = joint.limits->upper - joint.limits->lower;
    if (allowed <= 0 || range < 4 * std::numbers::pi || range < 1.5 * allowed) continue;
    const std::string seen = fmt::format("range {:.3g}, joint '{}' has {:.3g} rad", range, joint.name, allowed);
    if (range * std::numbers::pi / 180 > 1.2 * allowed) {  // too far in degrees, too
      throw InputError(
          fmt::format("{}: q{} looks like the motor's angle ({}), divide by the gear ratio (position_gain)",
                      log.file.string(), i + 1, seen));
    }
    throw InputError(fmt::format(
        "{}: q{} looks like degrees ({}), multiply by pi/180; or, if it is the motor's angle, divide by the "
        "gear ratio (position_gain)",
        log.file.string(), i + 1, seen));
  }
}

}  // namespace

std::vector<Log> read_logs(const Project& project, Role role, const fs::path& directory) {
  std::vector<bool> revolute;
  for (const Joint& joint : project.robot.joints) revolute.push_back(joint.type == JointType::revolute);
  std::vector<fs::path> files;  // all of them first: what one scenario makes may be a copy of another log
  for (const LogEntry& entry : project.logs) {
    if (entry.role == role) files.push_back(entry.scenario ? simulated(entry, project, directory) : entry.file);
  }
  check_copies(project, directory);
  std::vector<Log> logs;
  for (const LogEntry& entry : project.logs) {
    if (entry.role != role) continue;
    const fs::path& file = files[logs.size()];
    logs.push_back(read_log(file, project.robot.size(), revolute, entry.format, entry.from_s, entry.to_s));
    logs.back().role = role;
    logs.back().load = entry.load;
    check_turns(logs.back(), project.robot);
    static ReadLogs read;
    read.check(project, entry, logs.back());
  }
  return logs;
}

}  // namespace fxdyn
