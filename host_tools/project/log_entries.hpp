#pragma once

#include <filesystem>
#include <string>

#include "host_tools/project/project.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {

/// Where an entry's log is, once its scenario has been simulated.
std::filesystem::path log_file(const LogEntry& entry, const std::filesystem::path& directory);

/// The value of a project's key `columns`, as in "{ t = 0, q = [1, 2] }".
/// @throws InputError
LogFormat columns_of(const std::string& text, const Robot& robot);

/// The columns of the robot's joints where a file names them, as a bag does; of other files, the format as it is. See
/// signals/log_reader.hpp.
LogFormat with_joint_names(const std::filesystem::path& file, const LogFormat& format, const Robot& robot);

/// Whether the windows of two logs have a moment in common. Two topics of a file are two logs: whether one of them is
/// what is read where none is named, is seen by its motion.
bool share_time(const LogEntry& a, const LogEntry& b);

/// Whether two files hold the same bytes. Files that are missing are complained of where they are read.
bool same_content(const std::filesystem::path& a, const std::filesystem::path& b);

/// The complaint that two logs of a project share data; `how` says in which way.
InputError overlap(const Project& project, const LogEntry& a, const LogEntry& b, const char* how);
inline constexpr const char* same_bytes = "the same content under another name";

}  // namespace fxdyn
