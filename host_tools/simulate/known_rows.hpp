#pragma once

#include <cstdint>
#include <vector>

#include "host_tools/project/project.hpp"

namespace fxdyn {

/// Rows of the logs that were read so far, for what is read after them: a copy under other time stamps, or a part of
/// one, can't judge what was fitted on it.
class KnownRows {
 public:
  /// @throws InputError: the log holds rows of one with another role; names both lines of the project
  void add(const Project& project, const LogEntry& entry, const Log& log);

 private:
  struct Known {
    LogEntry entry;
    std::vector<std::uint64_t> prints;
  };
  std::vector<Known> known_;
};

}  // namespace fxdyn
