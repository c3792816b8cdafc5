#include "tests/campaign/run_case.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <chrono>
#include <thread>

#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "tests/campaign/generate.hpp"
#include "tests/campaign/score.hpp"

extern char** environ;

namespace fxdyn::campaign {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

struct Ended {
  int exit_code = 0;
  std::string how;  ///< empty: by itself
};

/// A process of its own, so that a crash is a result. Its output goes to a file.
Ended run(const std::vector<std::string>& command, const fs::path& output, double time_limit_s) {
  std::vector<char*> arguments;
  for (const std::string& part : command) arguments.push_back(const_cast<char*>(part.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 1, output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  pid_t child = 0;
  const int failed = posix_spawn(&child, command.front().c_str(), &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) throw InputError(fmt::format("{}: can't be started", command.front()));
  const auto start = Clock::now();
  int status = 0;
  while (waitpid(child, &status, WNOHANG) == 0) {
    if (seconds_since(start) > time_limit_s) {
      kill(child, SIGKILL);
      waitpid(child, &status, 0);
      return {-1, fmt::format("stopped after {:g} s", time_limit_s)};
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  if (WIFSIGNALED(status)) return {-1, fmt::format("crashed with signal {}", WTERMSIG(status))};
  return {WEXITSTATUS(status), ""};
}

std::string last_line(const fs::path& file) {
  std::string text = fs::exists(file) ? read_file(file) : "";
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  const auto at = text.find_last_of("\r\n");
  return at == std::string::npos ? text : text.substr(at + 1);
}

json attempt(const Case& wanted, const RunSettings& settings, const fs::path& folder) {
  const fs::path data = folder / "data", truth_folder = settings.out / "truth" / wanted.name, out = folder / "out";
  auto start = Clock::now();
  try {
    generate(wanted, data, truth_folder);
  } catch (const NotPossible& error) {
    return {{"status", "not_generated"}, {"message", error.what()}};
  }
  const json truth = json::parse(read_file(truth_folder / "truth.json"));
  json result{{"truth", truth}, {"generation_s", seconds_since(start)}};

  start = Clock::now();
  fs::remove_all(out);
  const fs::path output = folder / "diagnose.txt";
  const Ended ended =
      run({settings.program.string(), "diagnose", (data / "project.toml").string(), "--out", out.string()}, output,
          settings.time_limit_s);
  result["diagnosis_s"] = seconds_since(start);
  result["exit_code"] = ended.exit_code;
  if (!ended.how.empty() || !fs::exists(out / "diagnosis.json")) {
    result["status"] = "failed";
    result["message"] = ended.how.empty() ? fmt::format("exit {}: {}", ended.exit_code, last_line(output)) : ended.how;
    return result;
  }
  const json diagnosis = json::parse(read_file(out / "diagnosis.json"));
  // Scoring needs the models only where a gap was to be closed; a missing one is a failure of the diagnosis.
  const auto closure = true_closure(truth, truth_folder, out);
  result["score"] = score(truth, diagnosis, closure);
  result["status"] = "done";
  return result;
}

}  // namespace

json run_case(const Case& wanted, const RunSettings& settings) {
  const fs::path folder = settings.out / "cases" / wanted.name, file = folder / "result.json";
  if (fs::exists(file)) {
    try {
      json before = json::parse(read_file(file));
      if (before.value("program", "") == settings.program_hash) return before;
    } catch (const json::exception&) {  // not from this program
    }
    fs::remove(file);
  }
  fs::create_directories(folder);
  json result;
  try {
    result = attempt(wanted, settings, folder);
  } catch (const std::exception& error) {
    result["status"] = "failed";
    result["message"] = error.what();
  }
  result["name"] = wanted.name;
  result["program"] = settings.program_hash;
  result["group"] = to_string(wanted.group);
  const bool passed = result.contains("score") && result["score"].value("passed", false);
  result["passed"] = passed;
  if ((passed && !settings.keep) || result["status"] == "not_generated") {
    fs::remove_all(folder / "data");
    fs::remove_all(settings.out / "truth" / wanted.name);
  }
  // Half a gigabyte a hundred cases: a failed one can be made again from its scenarios, but is looked at with its logs.
  write_file(file, result.dump(1) + "\n");
  return result;
}

}  // namespace fxdyn::campaign
