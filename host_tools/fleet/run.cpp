#include "host_tools/fleet/run.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <map>
#include <optional>
#include <thread>

#include "host_tools/fleet/inputs.hpp"
#include "host_tools/fleet/program.hpp"
#include "host_tools/fleet/robot_folder.hpp"
#include "host_tools/fleet/signals.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/support/quiet.hpp"

namespace fxdyn::fleet {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// The programs of one call of run_tasks().
class Runner {
 public:
  Runner(const Fleet& fleet, const fs::path& directory, const RunOptions& options, std::size_t total)
      : fleet_(fleet), directory_(directory), options_(options), total_(total) {
    const std::size_t cores = threads_allowed();
    threads_ = std::max<std::size_t>(1, cores / std::max<std::size_t>(1, options.jobs));
  }
  ~Runner() {
    for (const auto& [process, running] : running_) {
      end(running.program);
      int status = 0;
      ::waitpid(process, &status, 0);
    }
  }
  Runner(const Runner&) = delete;
  Runner& operator=(const Runner&) = delete;

  void work(const std::vector<Task>& tasks) {
    const HeldSignals signals;
    std::size_t next = 0;
    while (next < tasks.size() || !running_.empty()) {
      while (next < tasks.size() && running_.size() < options_.jobs) begin(tasks[next++]);
      if (running_.empty()) continue;
      const int signal = signals.wait(until_the_next_is_late());
      if (signal != 0 && signal != SIGCHLD) stop(signal);
      end_late_ones();
      collect();
      if (!running_.empty() && seconds_since(said_) > options_.tell_s) say_what_is_at_work();
    }
  }

 private:
  struct Running {
    const Task* task;
    Program program;
    Lock lock;
  };

  void begin(const Task& task) {
    const RobotFolder folder(directory_, task.member->id);
    Lock lock(folder.path() / "lock");
    if (!lock.is_mine()) return say(task.member->id, "another process works on it: left to that");
    if (folder.is_done(task.hash)) return say(task.member->id, "done meanwhile");
    folder.begin(task.hash);
    const Program program =
        start({options_.program.string(), fleet_.verb, task.project.string(), "--out", folder.out().string()},
              fleet_.limits, folder.output(), threads_);
    running_.emplace(program.process, Running{&task, program, std::move(lock)});
  }

  /// [s], at most a second.
  double until_the_next_is_late() const {
    double left = std::min(1.0, options_.tell_s);
    for (const auto& [process, running] : running_)
      left = std::min(left, fleet_.limits.time_s - seconds_since(running.program.started));
    constexpr double shortest = 0.01;  // one that was ended is not yet collected
    return std::max(left, shortest);
  }

  void end_late_ones() {
    for (auto& [process, running] : running_) {
      if (running.program.too_slow || seconds_since(running.program.started) < fleet_.limits.time_s) continue;
      running.program.too_slow = true;
      end(running.program);
    }
  }

  void collect() {
    int status = 0;
    for (pid_t process = 0; (process = ::waitpid(-1, &status, WNOHANG)) > 0;) {
      const auto found = running_.find(process);
      if (found == running_.end()) continue;
      end(found->second.program);  // what it started and left behind
      const Running running = std::move(found->second);
      running_.erase(found);
      settle(running, status);
    }
  }

  void settle(const Running& running, int status) {
    const std::string& id = running.task->member->id;
    const RobotFolder folder(directory_, id);
    const double seconds = seconds_since(running.program.started);
    std::string complaint = ending_of(running.program, status, fleet_.limits, folder.output()).complaint;
    std::optional<RobotState> state;
    try {
      if (complaint.empty()) state = read_results_of(folder.path());
    } catch (const std::exception& error) {
      complaint = error.what();
    }
    check_not_full(complaint);
    if (state)
      folder.finish(*state, seconds);
    else
      folder.fail(complaint);
    say(id, state ? fmt::format("done in {:.1f} s", seconds) : "failed: " + complaint);
  }

  /// On a full disk all that follow would fail, too.
  void check_not_full(const std::string& complaint) const {
    for (const int cause : {ENOSPC, EDQUOT}) {
      if (complaint.find(std::strerror(cause)) != std::string::npos)
        throw InputError(fmt::format("{}: {}: free some space there; the same command goes on from what is done",
                                     directory_.string(), std::strerror(cause)));
    }
  }

  void say(const std::string& id, const std::string& what) {
    ++ended_;
    if (is_quiet()) return;
    const double left = seconds_since(started_) / static_cast<double>(ended_) * static_cast<double>(total_ - ended_);
    fmt::print(stderr, "[{}/{}, {:.0f} s left] {}: {}\n", ended_, total_, left, id, what);
    said_ = Clock::now();
  }

  /// A robot of an hour is not a robot that hangs.
  void say_what_is_at_work() {
    if (is_quiet()) return;
    constexpr std::size_t shown = 8;  // of a line that can be read
    std::vector<std::string> words;
    for (const auto& [process, running] : running_) {
      if (words.size() == shown) {
        words.push_back(fmt::format("and {} more", running_.size() - shown));
        break;
      }
      const std::string& id = running.task->member->id;
      const std::string step = last_line(RobotFolder(directory_, id).output());
      words.push_back(fmt::format("{} for {:.0f} s{}", id, seconds_since(running.program.started),
                                  step.empty() ? "" : fmt::format(" ({})", step)));
    }
    fmt::print(stderr, "[{}/{}] at work: {}\n", ended_, total_, fmt::join(words, ", "));
    said_ = Clock::now();
  }

  [[noreturn]] void stop(int signal) const {
    throw DataError(fmt::format("stopped ({}): {} of {} have ended; the same command goes on from there",
                                signal == SIGINT ? "Ctrl-C" : ::strsignal(signal), ended_, total_));
  }

  const Fleet& fleet_;
  const fs::path& directory_;
  const RunOptions& options_;
  std::map<pid_t, Running> running_;
  std::size_t total_, ended_ = 0, threads_ = 1;
  Clock::time_point started_ = Clock::now(), said_ = started_;
};

}  // namespace

std::vector<Task> tasks_of(const Fleet& fleet, const fs::path& directory, const std::vector<std::string>& only) {
  const std::size_t count = fleet.members.size();
  std::vector<std::optional<Task>> found(count);
  parallel_for(count, [&](std::size_t i) {
    const Member& member = fleet.members[i];
    if (!only.empty() && std::find(only.begin(), only.end(), member.id) == only.end()) return;
    const RobotFolder folder(directory, member.id);
    std::string complaint;
    try {
      const Inputs inputs = inputs_of(fleet, member, folder.path());
      if (!folder.is_done(inputs.hash)) found[i] = Task{&member, inputs.project, inputs.hash};
      return;
    } catch (const InputError& error) {
      complaint = error.what();
    } catch (const std::exception& error) {
      complaint = fmt::format("{}: {}", member.project.string(), error.what());
    }
    folder.fail(complaint);
  });
  std::vector<Task> tasks;
  for (const auto& task : found) {
    if (task) tasks.push_back(*task);
  }
  return tasks;
}

void run_tasks(const Fleet& fleet, const std::vector<Task>& tasks, const fs::path& directory,
               const RunOptions& options) {
  Runner(fleet, directory, options, tasks.size()).work(tasks);
}

}  // namespace fxdyn::fleet
