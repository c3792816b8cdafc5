#pragma once

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>

#include <cerrno>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

extern char** environ;

namespace fxdyn::test {

/// `PROGRAM fleet FILE --out FOLDER`, with further words of its command line. What it says goes where this program's
/// words go. Returns fleet.json.
/// @throws InputError: no such program @throws DataError: it was stopped, or could not work
inline nlohmann::json run_fleet(const std::filesystem::path& program, const std::filesystem::path& file,
                                const std::filesystem::path& folder, const std::vector<std::string>& words) {
  const std::filesystem::path summary = folder / "fleet.json";
  std::filesystem::remove(summary);
  std::vector<std::string> command{program.string(), "fleet", file.string(), "--out", folder.string()};
  command.insert(command.end(), words.begin(), words.end());
  std::vector<char*> arguments;
  for (std::string& word : command) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  pid_t child = 0;
  if (::posix_spawn(&child, arguments.front(), nullptr, nullptr, arguments.data(), environ) != 0)
    throw InputError(fmt::format("{}: can't be started", program.string()));
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {}
  // With exit code 1 some robots failed, which is in the summary, or it was stopped.
  if (!std::filesystem::exists(summary))
    throw DataError(fmt::format("`{} fleet` ended without a result; the same command goes on from what is done",
                                program.filename().string()));
  return nlohmann::json::parse(read_file(summary));
}

}  // namespace fxdyn::test
