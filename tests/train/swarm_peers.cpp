// swarm_peers: the project's particle swarm beside pagmo's PSO and CMA-ES on the search that `fxdyn train` makes, with
// the same number of evaluations (CMA-ES starts anew where it has converged before they are used up); with --time, how
// long that search takes.
#include <fmt/format.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/progress.hpp"
#include "host_tools/support/temporary_folder.hpp"
#include "host_tools/train/train.hpp"
#include "tests/train/swarm_fleet.hpp"

namespace {

using namespace fxdyn;
using namespace fxdyn::swarm_peers;
namespace fs = std::filesystem;
using Eigen::Index;
using Clock = std::chrono::steady_clock;

struct Options {
  int seeds = 10;
  Budget budget;
  std::vector<std::size_t> joints;  ///< empty: all
  std::uint64_t first_seed = 1;
  fs::path out, folder, seed_of;
  bool slurm = false;
  std::string slurm_args;
  double worst_ratio = 0, worst_evaluations = 0;  ///< 0: anything goes
  double duration = 0;                            ///< of the demo's logs [s]; 0: as they are
  bool time = false;
  double rows = 15000;
  std::vector<double> most_nodes{40, 120};
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return (values[(n - 1) / 2] + values[n / 2]) / 2;
}

/// Every method with every seed on one joint.
struct Runs {
  std::size_t joint;
  std::vector<std::vector<Trace>> traces;  ///< [method][seed]
  double best = 1e300;                     ///< of all runs

  std::vector<double> each(std::size_t method, auto&& value) const {
    std::vector<double> out;
    for (const Trace& trace : traces[method]) out.push_back(value(trace));
    return out;
  }
};

/// Our median over that of the better peer, of the worst joint.
struct Worst {
  double at_quarter = 0, at_half = 0, at_end = 0;  ///< J
  double evaluations = 0;                          ///< to within 1 % of the best; infinite: we never, a peer did
  double value() const { return std::max({at_quarter, at_half, at_end}); }
};

struct Table {
  std::string text;
  Worst worst;
};

constexpr double never_reached = std::numeric_limits<double>::infinity();

/// Medians of ours first. Where nobody got there, nobody is worse.
void add_ratio(double& worst, const std::vector<double>& medians) {
  const double peer = *std::min_element(medians.begin() + 1, medians.end());
  worst = std::max(worst, medians[0] == peer ? 1.0 : medians[0] / peer);
}

Table table_of(const std::vector<Runs>& all, std::size_t budget) {
  constexpr double near = 1.01;
  Table out;
  out.text =
      "| joint | method | median J after 25 % | 50 % | 100 % | worst of the seeds | median of the evaluations to "
      "within "
      "1 % of the best | never |\n|---|---|---|---|---|---|---|---|\n";
  for (const Runs& runs : all) {
    std::vector<double> quarter, half, end, needed;  // medians, by method
    for (std::size_t m = 0; m < methods.size(); ++m) {
      const auto after = [&](std::size_t evaluations) {
        return runs.each(m, [&](const Trace& trace) { return trace.after(evaluations); });
      };
      const std::vector<double> ends = after(budget), reached = runs.each(m, [&](const Trace&trace) {
        const auto at = trace.first_below(near * runs.best);
        return at ? static_cast<double>(*at) : never_reached;
      });
      quarter.push_back(median(after(budget / 4)));
      half.push_back(median(after(budget / 2)));
      end.push_back(median(ends));
      needed.push_back(median(reached));
      // Half of the runs or more did not get there: all that is known of the median is that it is beyond the budget.
      const std::string evaluations =
          std::isfinite(needed.back()) ? fmt::format("{:.0f}", needed.back()) : fmt::format("more than {}", budget);
      out.text += fmt::format("| {} | {} | {:.4f} % | {:.4f} % | {:.4f} % | {:.4f} % | {} | {} of {} |\n", runs.joint,
                              methods[m].name, 100 * quarter.back(), 100 * half.back(), 100 * end.back(),
                              100 * *std::max_element(ends.begin(), ends.end()), evaluations,
                              std::count(reached.begin(), reached.end(), never_reached), reached.size());
    }
    add_ratio(out.worst.at_quarter, quarter);
    add_ratio(out.worst.at_half, half);
    add_ratio(out.worst.at_end, end);
    add_ratio(out.worst.evaluations, needed);
  }
  return out;
}

/// By joint: the fleet's results are by seed.
std::vector<Runs> by_joint(const std::vector<std::vector<SeedRun>>& seeds, std::size_t budget) {
  std::vector<Runs> all;
  for (const SeedRun& of_joint : seeds.front()) all.push_back({of_joint.joint, {}});
  for (std::size_t j = 0; j < all.size(); ++j) {
    all[j].traces.resize(methods.size());
    for (const std::vector<SeedRun>& seed : seeds) {
      for (std::size_t m = 0; m < methods.size(); ++m) {
        all[j].traces[m].push_back(seed[j].of_method[m]);
        all[j].best = std::min(all[j].best, seed[j].of_method[m].after(budget));
      }
    }
  }
  return all;
}

int compare(const Options& options) {
  const TemporaryFolder temporary;
  FleetOptions fleet;
  fleet.fxdyn = FXDYN_PROGRAM;
  fleet.self = fs::read_symlink("/proc/self/exe");
  fleet.folder = fs::absolute(options.folder.empty() ? temporary.path() : options.folder);
  fleet.seeds = options.seeds;
  fleet.first_seed = options.first_seed;
  fleet.joints = options.joints;
  fleet.duration_s = options.duration;
  fleet.budget = options.budget;
  if (options.slurm) fleet.words = {"--slurm", "--slurm-args", options.slurm_args};
  const std::size_t budget = options.budget.evaluations();
  const Table table = table_of(by_joint(run_seeds(fleet), budget), budget);
  const std::string text = fmt::format(
      "{} seeds, {} particles, {} generations: {} evaluations a run. J: what the search minimises, share of rated "
      "torque.\n\n{}\nOurs over the better peer, medians, worst joint: J {:.4f} after 25 %, {:.4f} after 50 %, {:.4f} "
      "after 100 %; evaluations to within 1 % of the best {:.2f}.\n",
      options.seeds, options.budget.particles, options.budget.generations, budget, table.text, table.worst.at_quarter,
      table.worst.at_half, table.worst.at_end, table.worst.evaluations);
  fmt::print("{}", text);
  if (!options.out.empty()) write_file(options.out, text);
  const auto within = [](double ratio, double most, const char* what) {
    if (most <= 0 || ratio <= most) return true;
    fmt::print(stderr, "{} of ours is {:.4f} times the better peer's, at most {} is allowed\n", what, ratio, most);
    return false;
  };
  const bool good = within(table.worst.value(), options.worst_ratio, "J");
  return within(table.worst.evaluations, options.worst_evaluations, "the number of evaluations") && good ? 0 : 1;
}

/// Of this process, all threads [s].
double processor_seconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

int time_training(const Options& options) {
  const TemporaryFolder folder;
  // Filters cut the ends off and decimate as they find the motion, so the duration follows from two tries.
  double duration = 20;
  std::unique_ptr<Identified> logs;
  for (int round = 0; round < 3; ++round) {
    const fs::path place = folder.path() / std::to_string(round);
    logs = std::make_unique<Identified>(demo_of(place, std::round(duration)), place);
    duration *= options.rows / static_cast<double>(logs->fitter->rows());
  }
  Index samples = 0;
  for (const ProcessedLog& log : logs->data.logs) samples += log.samples();
  std::string text = fmt::format(
      "{} rows of {} samples, {} joints, {} particles, {} generations.\n\n| nodes | wall s | processor s | half of it "
      "| "
      "evaluations | joints kept |\n|---|---|---|---|---|---|\n",
      logs->fitter->rows(), samples, logs->fitter->joints(), options.budget.particles, options.budget.generations);
  for (const double most : options.most_nodes) {
    TrainSettings settings = logs->project.train;
    settings.pso = PsoSettings{};
    settings.pso->particles = options.budget.particles;
    settings.pso->iterations = options.budget.generations;
    settings.pso->stall = options.budget.generations + 1;
    settings.pso->nodes = {5, most};
    Fitter fitter = *logs->fitter;
    Progress progress;
    const auto start = Clock::now();
    const double before = processor_seconds();
    const std::vector<TrainOutcome> outcomes = train(fitter, settings, progress);
    const double processor = processor_seconds() - before;
    const double wall = std::chrono::duration<double>(Clock::now() - start).count();
    int evaluations = 0, kept = 0;
    for (const TrainOutcome& outcome : outcomes) {
      evaluations += outcome.evaluations;
      kept += outcome.kept;
    }
    text += fmt::format("| 5 to {:.0f} | {:.1f} | {:.1f} | {:.1f} | {} | {} |\n", most, wall, processor, processor / 2,
                        evaluations, kept);
  }
  fmt::print("{}", text);
  if (!options.out.empty()) write_file(options.out, text);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app{"The particle swarm beside pagmo's, and how long it takes"};
  app.add_option("--seeds", options.seeds, "searches of each kind")->check(CLI::PositiveNumber);
  app.add_option("--first-seed", options.first_seed, "the others follow");
  app.add_option("--joints", options.joints, "from 1; all unless given")->delimiter(',');
  app.add_option("--particles", options.budget.particles, "of each search")->check(CLI::Range(5, 1000));
  app.add_option("--generations", options.budget.generations, "after the first")->check(CLI::PositiveNumber);
  app.add_option("--duration", options.duration, "of the logs that are compared on [s]; shorter ones take less time")
      ->check(CLI::PositiveNumber);
  app.add_option("--out", options.out, "the table, Markdown");
  app.add_option("--folder", options.folder, "of the fleet of seeds: what is done in it is not done again");
  app.add_flag("--slurm", options.slurm, "the seeds as a job array of Slurm: --folder has to be seen by all nodes");
  app.add_option("--slurm-args", options.slurm_args, "further arguments of sbatch")->needs("--slurm");
  app.add_option("--seed-of", options.seed_of, "the fleet's own: works on the seed of this project, results in --out");
  app.add_option("--worst-ratio", options.worst_ratio,
                 "fail where our median J, after 25, 50 or 100 %, is more than so many times the better peer's");
  app.add_option("--worst-evaluations", options.worst_evaluations,
                 "the same of the evaluations to within 1 % of the best");
  app.add_flag("--time", options.time, "time the search on long logs instead");
  app.add_option("--rows", options.rows, "of the long logs")->check(CLI::PositiveNumber);
  app.add_option("--most-nodes", options.most_nodes, "upper bounds to time")->delimiter(',');
  CLI11_PARSE(app, argc, argv);
  try {
    if (!options.seed_of.empty()) return run_seed(options.seed_of, options.out, options.joints, options.budget), 0;
    return options.time ? time_training(options) : compare(options);
  } catch (const InputError& error) {
    fmt::print(stderr, "swarm_peers: {}\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "swarm_peers: {}\n", error.what());
    return 1;
  }
}
