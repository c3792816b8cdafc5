#pragma once

#include <filesystem>
#include <vector>

#include "host_tools/project/project.hpp"
#include "host_tools/simulate/known_rows.hpp"

namespace fxdyn {

/// The logs of the given role, read and checked against the robot. Those of a scenario are simulated into
/// `directory`/logs first, where they are missing or older than the scenario.
/// @param known logs that were read before, to which these come; null: they are not compared
/// @throws InputError as read_log(); a scenario without the log; data that two logs share
std::vector<Log> read_logs(const Project& project, Role role, const std::filesystem::path& directory,
                           KnownRows* known = nullptr);

}  // namespace fxdyn
