// Many robots: on this machine, or as a job array of a cluster.

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "host_tools/cli/verb.hpp"
#include "host_tools/fleet/acceptance.hpp"
#include "host_tools/fleet/robot_folder.hpp"
#include "host_tools/fleet/run.hpp"
#include "host_tools/fleet/slurm.hpp"
#include "host_tools/fleet/summary.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/support/quiet.hpp"

namespace fxdyn::cli {
namespace {

namespace fs = std::filesystem;

struct FleetOptions {
  std::string file, out, program;
  int jobs = 0;  ///< 0: the cores
  std::vector<std::string> accepted;
  bool slurm = false;
  std::string slurm_args;
  fleet::SlurmOptions cluster;
  fleet::Chunk chunk;
};

void add_common(CLI::App& verb, FleetOptions& options, const char* jobs) {
  verb.add_option("FLEET", options.file, "fleet file (TOML)")->required();
  verb.add_option("--out", options.out, "directory for the results of all robots")->required();
  verb.add_option("--jobs", options.jobs, fmt::format("robots at once (default: {})", jobs))
      ->check(CLI::Range(1, 4096));
  verb.add_option("--program", options.program,
                  "started for each robot as PROGRAM VERB PROJECT --out DIR/robots/ID/out (default: this one)");
}

fleet::RunOptions run_options(const FleetOptions& options) {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  const fs::path program = options.program.empty() ? self : fs::absolute(options.program);
  if (program.empty() || ::access(program.c_str(), X_OK) != 0)
    throw InputError(fmt::format("--program {}: is no program that can be started", program.string()));
  return {program, options.jobs > 0 ? static_cast<std::size_t>(options.jobs) : threads_allowed()};
}

/// One fleet at a time in a folder.
fleet::Lock lock_of(const fs::path& directory) {
  fleet::Lock lock(directory / "lock");
  if (lock.is_mine()) return lock;
  throw InputError(fmt::format("{}: another fxdyn fleet works in it: wait until it has ended, or choose another --out",
                               directory.string()));
}

void work(const fleet::Fleet& fleet, const fs::path& directory, const FleetOptions& options) {
  const fleet::RunOptions run = run_options(options);
  const std::vector<fleet::Task> tasks = fleet::tasks_of(fleet, directory);
  if (!is_quiet()) fmt::print(stderr, "{} of {} robots to do\n", tasks.size(), fleet.members.size());
  if (!options.slurm) return fleet::run_tasks(fleet, tasks, directory, run);
  fleet::SlurmOptions cluster = options.cluster;
  cluster.arguments = fleet::words_of(options.slurm_args);
  fleet::run_on_slurm(fleet, tasks, directory, run, cluster);
}

void run_fleet(const FleetOptions& options) {
  const fleet::Fleet fleet = fleet::read_fleet(options.file);
  if (options.slurm && options.accepted.empty()) fleet::check_slurm();
  check_writable(options.out);
  const fs::path directory = fs::absolute(options.out).lexically_normal();
  const fleet::Lock lock = lock_of(directory);
  fleet::remove_leftovers(directory);
  if (options.accepted.empty())
    work(fleet, directory, options);
  else
    fleet::accept(fleet, directory, options.accepted);
  const fleet::Summary summary = fleet::summarise(fleet, directory);
  fmt::print("{}", fleet::write_summary(summary, options.out));
  if (is_quiet()) {
    for (const fleet::RobotSummary& robot : summary.robots)
      if (!robot.complaint.empty()) fmt::print(stderr, "{} failed: {}\n", robot.id, robot.complaint);
  }
  const bool failed = std::any_of(summary.robots.begin(), summary.robots.end(),
                                  [](const fleet::RobotSummary& robot) { return !robot.complaint.empty(); });
  if (failed && options.accepted.empty())
    throw DataError("robots failed, see the list; the others are done, and the same command tries these again");
}

/// Programs at once: as many as the cluster gives the task.
int jobs_of_task() {
  const char* set = std::getenv("SLURM_CPUS_PER_TASK");
  const int cpus = set == nullptr ? 0 : std::atoi(set);
  return std::max(1, cpus);
}

}  // namespace

Action add_fleet(CLI::App& verb) {
  const auto options = std::make_shared<FleetOptions>();
  add_common(verb, *options, "the cores");
  verb.add_option("--accept", options->accepted,
                  "runs nothing: today's state of these robots (ids, or all) is their new baseline");
  verb.add_flag("--slurm", options->slurm, "as a job array of Slurm; --out has to be seen by all nodes");
  verb.add_option("--slurm-args", options->slurm_args, "further arguments of sbatch, as in \"-p night --mem=4G\"");
  verb.add_option("--chunk-size", options->cluster.chunk_size, "robots a task of the array (default: from their times)")
      ->check(CLI::PositiveNumber);
  return [options] { run_fleet(*options); };
}

Action add_fleet_worker(CLI::App& verb) {
  const auto options = std::make_shared<FleetOptions>();
  add_common(verb, *options, "SLURM_CPUS_PER_TASK, else 1");
  verb.add_option("--chunk", options->chunk.index, "which part of the fleet, from 0")->required();
  verb.add_option("--of", options->chunk.of, "number of parts (default: the part is DIR/chunks/CHUNK.txt)")
      ->check(CLI::PositiveNumber);
  return [options] {
    if (options->chunk.of > 0 && options->chunk.index >= options->chunk.of)
      throw InputError(fmt::format("--chunk {}: expected 0 .. {}", options->chunk.index, options->chunk.of - 1));
    if (options->jobs == 0) options->jobs = jobs_of_task();
    const fleet::Fleet fleet = fleet::read_fleet(options->file);
    check_writable(options->out);
    fleet::work_on_chunk(fleet, fs::absolute(options->out).lexically_normal(), options->chunk, run_options(*options));
  };
}

}  // namespace fxdyn::cli
