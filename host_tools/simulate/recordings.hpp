#pragma once

#include <filesystem>
#include <vector>

#include "host_tools/project/project.hpp"

namespace fxdyn {

/// The logs of the given role, read and checked against the robot. Those of a scenario are simulated into
/// `directory`/logs first, where they are missing or older than the scenario.
/// @throws InputError as read_log(); a scenario without the log; data that two logs share
std::vector<Log> read_logs(const Project& project, Role role, const std::filesystem::path& directory);

}  // namespace fxdyn
