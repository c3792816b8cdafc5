#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "host_tools/fleet/fleet_file.hpp"

namespace fxdyn::fleet {

struct RunOptions {
  std::filesystem::path program;  ///< started as PROGRAM VERB PROJECT --out DIR/robots/ID/out; absolute
  std::size_t jobs = 1;           ///< programs at once
  double tell_s = 30;             ///< where none ends, a line says so often what is at work [s]; hand
};

/// A robot whose result is missing or of other inputs.
struct Task {
  const Member* member = nullptr;
  std::filesystem::path project;
  std::string hash;
};

/// What there is to do. A robot whose project is gone or wrong gets its error.txt here.
/// @param only ids; empty: all
std::vector<Task> tasks_of(const Fleet& fleet, const std::filesystem::path& directory,
                           const std::vector<std::string>& only = {});

/// Works on the tasks, with a line on stderr for each that ends. Robots on which another process works are left to it.
/// @throws DataError: Ctrl-C or SIGTERM; all programs are ended, what is done stays
/// @throws InputError: the state can't be written
void run_tasks(const Fleet& fleet, const std::vector<Task>& tasks, const std::filesystem::path& directory,
               const RunOptions& options);

}  // namespace fxdyn::fleet
