#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "host_tools/fleet/fleet_file.hpp"

namespace fxdyn::fleet {

/// A program under way, in a process group of its own. It ends with this one, whatever ends this one.
struct Program {
  pid_t process = -1;
  std::chrono::steady_clock::time_point started;
  bool too_slow = false;  ///< it was ended because of its time
};

/// @param output what it prints; replaced @param threads that it may use @throws InputError: it can't be started
Program start(const std::vector<std::string>& words, const Limits& limits, const std::filesystem::path& output,
              std::size_t threads);
/// It and all that it started.
void end(const Program& program);

/// That it has printed so far, but empty ones; empty: none.
std::string last_line(const std::filesystem::path& output);

/// What the end of a program means.
struct Ending {
  std::string complaint;  ///< one line; empty: it is well
};
/// @param status as of waitpid(2)
Ending ending_of(const Program& program, int status, const Limits& limits, const std::filesystem::path& output);

}  // namespace fxdyn::fleet
