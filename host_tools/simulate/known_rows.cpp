#include "host_tools/simulate/known_rows.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "host_tools/signals/same_motion.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

constexpr std::size_t fewest = 50;     // rows that are no coincidence
constexpr double share_of_copy = 0.1;  // of the shorter log's rows

/// Windows of one log are told apart by their times.
bool is_source(const LogEntry& a, const LogEntry& b) {
  return a.file == b.file && a.scenario == b.scenario && a.scenario_log == b.scenario_log;
}

}  // namespace

void KnownRows::add(const Project& project, const LogEntry& entry, const Log& log) {
  const auto again = [&](const Known& one) {
    return one.entry.role == entry.role && is_source(one.entry, entry) && one.entry.from_s == entry.from_s;
  };
  if (std::any_of(known_.begin(), known_.end(), again)) return;
  std::vector<std::uint64_t> prints = row_prints(log);
  for (const Known& other : known_) {
    if (other.entry.role == entry.role || is_source(other.entry, entry)) continue;
    const std::size_t common = rows_in_common(other.prints, prints);
    const std::size_t shorter = std::min(other.prints.size(), prints.size());
    if (common < fewest || static_cast<double>(common) < share_of_copy * static_cast<double>(shorter)) continue;
    throw InputError(
        fmt::format("{}:{}: {} of its {} moving rows are those of the log in line {}, under other time stamps: a copy "
                    "can't judge what was fitted on it; record another motion",
                    project.file.string(), entry.line, common, prints.size(), other.entry.line));
  }
  known_.push_back({entry, std::move(prints)});
}

}  // namespace fxdyn
