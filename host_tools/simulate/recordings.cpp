#include "host_tools/simulate/recordings.hpp"

#include <fmt/format.h>

#include <numbers>

#include "host_tools/project/log_entries.hpp"
#include "host_tools/readers/log_reader.hpp"
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

std::vector<Log> read_logs(const Project& project, Role role, const fs::path& directory, KnownRows* known) {
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
    if (known != nullptr) known->add(project, entry, logs.back());
  }
  return logs;
}

}  // namespace fxdyn
