#include "host_tools/project/log_entries.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "host_tools/readers/log_reader.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {

namespace fs = std::filesystem;

fs::path log_file(const LogEntry& entry, const fs::path& directory) {
  return entry.scenario ? directory / "logs" / entry.scenario->stem() / (entry.scenario_log + ".csv") : entry.file;
}

LogFormat with_joint_names(const fs::path& file, const LogFormat& format, const Robot& robot) {
  std::vector<std::string> names;
  for (const Joint& joint : robot.joints) names.push_back(joint.name);
  return with_joint_names(file, format, names);
}

bool share_time(const LogEntry& a, const LogEntry& b) {
  const auto topic = [](const LogEntry& entry) {
    const auto found = entry.format.columns.find(topic_key);
    return found == entry.format.columns.end() ? "" : found->second;
  };
  if (topic(a) != topic(b)) return false;
  constexpr double infinity = std::numeric_limits<double>::infinity();
  return std::max(a.from_s.value_or(-infinity), b.from_s.value_or(-infinity)) <
         std::min(a.to_s.value_or(infinity), b.to_s.value_or(infinity));
}

bool same_content(const fs::path& a, const fs::path& b) {
  std::error_code missing;
  const auto size = fs::file_size(a, missing);
  return !missing && size == fs::file_size(b, missing) && !missing && read_file(a) == read_file(b);
}

InputError overlap(const Project& project, const LogEntry& a, const LogEntry& b, const char* how) {
  return InputError(fmt::format("{}:{}: overlaps the log in line {} ({}); separate them by from_s and to_s",
                                project.file.string(), b.line, a.line, how));
}

}  // namespace fxdyn
