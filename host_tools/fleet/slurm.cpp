#include "host_tools/fleet/slurm.hpp"

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <sstream>

#include "host_tools/fleet/program.hpp"
#include "host_tools/fleet/robot_folder.hpp"
#include "host_tools/fleet/signals.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn::fleet {
namespace {

namespace fs = std::filesystem;

fs::path chunk_file(const fs::path& directory, std::size_t chunk) {
  return directory / "chunks" / fmt::format("{}.txt", chunk);
}
/// Of a file that the worker writes as soon as it runs.
constexpr const char* sign_extension = ".started";
fs::path chunk_sign(const fs::path& directory, std::size_t chunk) {
  return directory / "chunks" / fmt::format("{}{}", chunk, sign_extension);
}

/// Where a shell would find it; empty: nowhere.
std::string in_path(const std::string& name) {
  const char* set = std::getenv("PATH");
  std::istringstream folders(set == nullptr ? "/bin:/usr/bin" : set);
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path file = fs::path(folder.empty() ? "." : folder) / name;
    std::error_code ignored;
    if (fs::is_regular_file(file, ignored) && ::access(file.c_str(), X_OK) == 0) return file.string();
  }
  return "";
}

InputError no_command(const std::string& name) {
  return InputError(
      fmt::format("no {} on this machine: run it where Slurm's commands are, or leave out --slurm", name));
}

struct Answer {
  bool good = false;
  std::string text;
};

/// What a command of the cluster prints.
Answer ask(std::vector<std::string> words, const fs::path& directory) {
  const fs::path output = directory / "slurm" / (words.front() + ".txt");
  const std::string program = in_path(words.front());
  if (program.empty()) throw no_command(words.front());
  words.front() = program;
  constexpr std::size_t one_thread = 1;  // the array inherits it; a worker has as many programs as CPUs
  const Program running = start(words, {}, output, one_thread);
  int status = 0;
  while (::waitpid(running.process, &status, 0) < 0 && errno == EINTR) {}
  std::string text = read_file(output);
  while (text.ends_with('\n')) text.pop_back();
  return {WIFEXITED(status) && WEXITSTATUS(status) == 0, text};
}

std::string quoted(const std::string& word) {
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

/// [s]; none has been measured: 0.
double mean_seconds(const Fleet& fleet, const fs::path& directory) {
  double sum = 0, count = 0;
  for (const Member& member : fleet.members) {
    if (const auto seconds = RobotFolder(directory, member.id).seconds()) sum += *seconds, ++count;
  }
  return count > 0 ? sum / count : 0;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

class Submitter {
 public:
  Submitter(const Fleet& fleet, const fs::path& directory, const RunOptions& run, const SlurmOptions& options)
      : fleet_(fleet), directory_(directory), run_(run), options_(options) {}

  void work(const std::vector<Task>& tasks) {
    ask({"sbatch", "--version"}, directory_);  // before anything is measured
    std::vector<Task> missing = tasks;
    if (options_.chunk_size == 0 && mean_seconds(fleet_, directory_) == 0) {
      fmt::print(stderr, "one robot here first: its time decides how many make a task\n");
      run_tasks(fleet_, {missing.front()}, directory_, run_);
      missing.erase(missing.begin());
    }
    wait_for_the_one_before(missing);
    for (int useless = 0; !missing.empty();) {
      const std::size_t before = missing.size();
      submit(missing);
      wait_for(missing);
      drop_ended(missing);
      if (missing.empty()) return;
      useless = missing.size() < before ? 0 : useless + 1;
      if (useless >= options_.useless_rounds)
        complain(has_started() ? "again it ended no robot"
                               : "no task of it has written to DIR: put --out where all nodes see the same folder");
      fmt::print(stderr, "job {} is gone, {} robots are missing: submitted again\n", job_, missing.size());
    }
  }

 private:
  void drop_ended(std::vector<Task>& tasks) const {
    std::erase_if(tasks, [&](const Task& task) { return RobotFolder(directory_, task.member->id).is_ended(); });
  }

  /// The array of a submitter that was killed may still do the work.
  void wait_for_the_one_before(std::vector<Task>& missing) {
    const fs::path file = last_job();
    if (!fs::exists(file)) return;
    job_ = read_file(file);
    if (job_.empty() || is_gone()) return;
    fmt::print(stderr, "job {} of before goes on: waiting for it, `scancel {}` ends it\n", job_, job_);
    for (const Task& task : missing) RobotFolder(directory_, task.member->id).forget();
    wait_for(missing);
    drop_ended(missing);
  }

  fs::path last_job() const { return directory_ / "slurm" / "job"; }

  void submit(const std::vector<Task>& missing) {
    const double seconds = mean_seconds(fleet_, directory_);
    std::size_t size = options_.chunk_size;
    if (size == 0) size = seconds > 0 ? static_cast<std::size_t>(std::ceil(options_.chunk_s / seconds)) : 1;
    size = std::max(size, (missing.size() + options_.most_tasks - 1) / options_.most_tasks);
    chunks_ = (missing.size() + size - 1) / size;
    std::error_code none;
    fs::remove_all(directory_ / "chunks", none);
    for (std::size_t k = 0; k < chunks_; ++k) {
      std::string ids;
      for (std::size_t i = k * size; i < std::min(missing.size(), (k + 1) * size); ++i) {
        RobotFolder(directory_, missing[i].member->id).forget();
        ids += missing[i].member->id + "\n";
      }
      write_file(chunk_file(directory_, k), ids);
    }
    std::error_code error;
    const std::string self = fs::read_symlink("/proc/self/exe", error).string();
    std::string command = fmt::format("exec {} fleet-worker {} --out {} --chunk $SLURM_ARRAY_TASK_ID", quoted(self),
                                      quoted(fleet_.file.string()), quoted(directory_.string()));
    if (run_.program != self) command += " --program " + quoted(run_.program.string());
    std::vector<std::string> words{"sbatch", "--parsable", "--job-name=fxdyn-fleet",
                                   fmt::format("--array=0-{}", chunks_ - 1),
                                   "--output=" + (directory_ / "slurm" / "%A_%a.txt").string()};
    words.insert(words.end(), options_.arguments.begin(), options_.arguments.end());
    words.push_back("--wrap=" + command);
    const Answer answer = ask(words, directory_);
    if (!answer.good)
      throw InputError(fmt::format("sbatch refuses: {}: change --slurm-args, or leave out --slurm", answer.text));
    job_ = answer.text.substr(0, answer.text.find(';'));  // "id;cluster"
    write_file(last_job(), job_);
    fmt::print(stderr, "job {}: {} tasks of up to {} robots\n", job_, chunks_, size);
  }

  /// Until all have ended or the array is gone.
  void wait_for(const std::vector<Task>& missing) {
    const HeldSignals signals;
    double since_asked = 0;
    std::size_t shown = 0;
    auto last = std::chrono::steady_clock::now(), told = last;
    while (true) {
      const auto ended = static_cast<std::size_t>(std::count_if(missing.begin(), missing.end(), [&](const Task& task) {
        return RobotFolder(directory_, task.member->id).is_ended();
      }));
      if (ended != shown) {
        fmt::print(stderr, "[{}/{}]\n", ended, missing.size());
        last = told = std::chrono::steady_clock::now();
      }
      shown = ended;
      if (ended == missing.size()) return;
      pause(signals, options_.look_s);
      if (is_stuck(seconds_since(last))) return pause(signals, options_.settle_s);
      since_asked += options_.look_s;
      if (since_asked < options_.ask_s) continue;
      since_asked = 0;
      if (is_gone()) return pause(signals, options_.settle_s);
      if (seconds_since(told) < options_.tell_s) continue;
      fmt::print(stderr, "[{}/{}] job {}: {}\n", ended, missing.size(), job_, in_queue_);
      told = std::chrono::steady_clock::now();
    }
  }

  /// Every worker ends a robot within its time limit. A controller that was killed may believe for ever that a task
  /// runs whose end it has missed.
  bool is_stuck(double quiet_s) const {
    if (!has_started() || quiet_s < fleet_.limits.time_s + options_.margin_s) return false;
    fmt::print(stderr, "job {} has ended no robot for {:.0f} s: cancelled\n", job_, quiet_s);
    if (!in_path("scancel").empty()) ask({"scancel", job_}, directory_);
    return true;
  }

  void pause(const HeldSignals& signals, double seconds) const {
    const int signal = signals.wait(seconds);
    if (signal == 0 || signal == SIGCHLD) return;
    throw DataError(fmt::format(
        "stopped: job {} goes on; the same command waits for what is missing, `scancel {}` ends it", job_, job_));
  }

  /// A controller that does not answer says nothing of the job.
  bool is_gone() {
    const Answer answer = ask({"squeue", "-h", "-j", job_, "-o", "%i %T %r"}, directory_);
    in_queue_ = answer.text.empty() ? "not in the queue" : answer.text;
    std::replace(in_queue_.begin(), in_queue_.end(), '\n', ';');
    return answer.good ? answer.text.empty() : answer.text.find("Invalid job id") != std::string::npos;
  }

  bool has_started() const {
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(directory_ / "chunks", error)) {
      if (entry.path().extension() == sign_extension) return true;
    }
    return false;
  }

  [[noreturn]] void complain(const std::string& what) const {
    throw DataError(
        fmt::format("job {}: {}; what its tasks said is in {}", job_, what, (directory_ / "slurm").string()));
  }

  const Fleet& fleet_;
  const fs::path& directory_;
  const RunOptions& run_;
  const SlurmOptions& options_;
  std::string job_;
  std::string in_queue_;  ///< what squeue said last of the job: tasks, states, reasons
  std::size_t chunks_ = 0;
};

}  // namespace

void check_slurm() {
  if (in_path("sbatch").empty()) throw no_command("sbatch");
}

std::vector<std::string> words_of(const std::string& text) {
  std::vector<std::string> out;
  bool within = false;  // a word, which may be empty in quotes
  char quote = 0;
  for (const char c : text) {
    if (quote != 0 ? c == quote : (c == '\'' || c == '"')) {
      quote = quote != 0 ? '\0' : c;
      if (!within) out.emplace_back();
      within = true;
    } else if (quote == 0 && (c == ' ' || c == '\t')) {
      within = false;
    } else {
      if (!within) out.emplace_back();
      within = true;
      out.back() += c;
    }
  }
  if (quote != 0) throw InputError(fmt::format("--slurm-args {}: a {} is not closed", text, quote));
  return out;
}

void run_on_slurm(const Fleet& fleet, const std::vector<Task>& tasks, const fs::path& directory, const RunOptions& run,
                  const SlurmOptions& options) {
  if (!tasks.empty()) Submitter(fleet, directory, run, options).work(tasks);
}

void work_on_chunk(const Fleet& fleet, const fs::path& directory, const Chunk& chunk, const RunOptions& run) {
  std::vector<std::string> ids;
  if (chunk.of > 0) {
    for (std::size_t i = chunk.index; i < fleet.members.size(); i += chunk.of) ids.push_back(fleet.members[i].id);
  } else {
    const fs::path file = chunk_file(directory, chunk.index);
    if (!fs::exists(file))
      throw InputError(
          fmt::format("{}: is not there on this node: put --out where all nodes see the same folder, or add "
                      "--of N where nobody has submitted",
                      file.string()));
    write_file(chunk_sign(directory, chunk.index), "");
    std::istringstream lines(read_file(file));
    for (std::string id; std::getline(lines, id);) ids.push_back(id);
  }
  if (ids.empty()) return;
  run_tasks(fleet, tasks_of(fleet, directory, ids), directory, run);
  for (const std::string& id : ids) {
    if (const std::string complaint = RobotFolder(directory, id).complaint(); !complaint.empty())
      fmt::print(stderr, "{} failed: {}\n", id, complaint);
  }
}

}  // namespace fxdyn::fleet
