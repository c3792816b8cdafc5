#pragma once

#include <filesystem>

#include "host_tools/log/project.hpp"

namespace fxdyn {

/// Where an entry's log is, once its scenario has been simulated.
std::filesystem::path log_file(const LogEntry& entry, const std::filesystem::path& directory);

}  // namespace fxdyn
