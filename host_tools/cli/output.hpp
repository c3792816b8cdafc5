#pragma once

#include <CLI/CLI.hpp>
#include <exception>
#include <filesystem>
#include <string>

namespace fxdyn::cli {

/// How a verb ended: its exit code and, where it is not 0, one line that says why.
struct Ending {
  int exit = 0;
  std::string complaint;
};
/// 2: bad input or usage, 1: the data can't support the answer.
Ending ending_of(const std::exception_ptr& error);

/// What a verb says on standard output: its tables, nothing (--quiet: notes and complaints
/// are on standard error), or its results as JSON (--json).
class Output {
 public:
  /// Adds --quiet and --json to a verb; not to those whose output is a file by itself. A verb may have a --json of its
  /// own.
  static void add_options(CLI::App& verb);
  /// From here on nothing that is printed appears, where the options say so.
  explicit Output(const CLI::App& verb);
  /// Standard output is again what it was.
  ~Output();
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;
  /// The verb has ended: prints {verb, exit, complaint, out, files, results} where JSON is wanted. `files`: what --out
  /// got since the beginning; `results`: what the JSON files among them hold.
  void end(const Ending& ending);

 private:
  void restore();
  std::string verb_;
  std::filesystem::path out_;
  std::filesystem::file_time_type begin_;
  bool json_ = false;
  int stdout_ = -1;  ///< while it is redirected
};

}  // namespace fxdyn::cli
