// swarm_peers: the project's particle swarm beside pagmo's PSO and CMA-ES on the search that `fxdyn train` makes, with
// the same number of evaluations (CMA-ES starts anew where it has converged before they are used up); with --time, how
// long that search takes.
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <pagmo/algorithm.hpp>
#include <pagmo/algorithms/cmaes.hpp>
#include <pagmo/algorithms/pso.hpp>
#include <pagmo/population.hpp>
#include <pagmo/problem.hpp>
#include <sstream>

#include "host_tools/identify/identify.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/train/swarm.hpp"
#include "host_tools/train/train.hpp"
#include "host_tools/train/tuning.hpp"

namespace {

using namespace fxdyn;
namespace fs = std::filesystem;
using Eigen::Index;
using Eigen::VectorXd;
using Clock = std::chrono::steady_clock;

const fs::path demo = fs::path(FXDYN_SOURCE_DIR) / "host_tools/demo";

struct Options {
  int seeds = 10, particles = 30, generations = 40;
  std::vector<std::size_t> joints;  ///< empty: all
  std::uint64_t first_seed = 1;
  fs::path out;
  double worst_ratio = 0, worst_evaluations = 0;  ///< 0: anything goes
  double duration = 0;                            ///< of the demo's logs [s]; 0: as they are
  bool time = false;
  double rows = 15000;
  std::vector<double> most_nodes{40, 120};
};

/// A folder of this process for simulated logs, gone at the end.
class Folder {
 public:
  Folder() : path_(fs::temp_directory_path() / fmt::format("fxdyn-swarm-{}", ::getpid())) {
    fs::create_directories(path_);
  }
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// The demo with logs of another duration.
fs::path demo_of(const fs::path& folder, double duration_s) {
  fs::create_directories(folder);
  for (const char* name : {"project.toml", "puma560.urdf"}) write_file(folder / name, read_file(demo / name));
  std::istringstream lines(read_file(demo / "scenario.toml"));
  std::string text;
  for (std::string line; std::getline(lines, line);)
    text += (line.starts_with("duration_s") ? fmt::format("duration_s = {}", duration_s) : line) + "\n";
  write_file(folder / "scenario.toml", text);
  return folder / "project.toml";
}

/// Structure and friction of a project, as the search of the BLS finds them.
struct Identified {
  Identified(const fs::path& file, const fs::path& directory)
      : project(read_project(file)), data(read_gate_data(project, directory)) {
    Progress progress;
    fitter = identify(project, data, progress);
    progress.done();
  }
  Project project;
  GateData data;
  std::unique_ptr<Fitter> fitter;
};

/// Best value so far after each evaluation.
class Trace {
 public:
  double operator()(const BlsFitness& fitness, const VectorXd& x) {
    const double value = fitness(x).value;
    best_.push_back(best_.empty() ? value : std::min(value, best_.back()));
    return value;
  }
  double after(std::size_t evaluations) const { return best_[std::min(evaluations, best_.size()) - 1]; }
  /// Nothing: never.
  std::optional<std::size_t> first_below(double value) const {
    const auto at = std::find_if(best_.begin(), best_.end(), [&](double best) { return best <= value; });
    return at != best_.end() ? std::optional<std::size_t>(at - best_.begin() + 1) : std::nullopt;
  }
  std::size_t evaluations() const { return best_.size(); }

 private:
  std::vector<double> best_;
};

/// The search as pagmo sees it: the box scaled to [0, 1], which its CMA-ES starts from with the same width everywhere.
struct InUnitBox {
  const BlsFitness* fitness = nullptr;
  Trace* trace = nullptr;
  pagmo::vector_double fitness_at(const pagmo::vector_double& u) const {
    const VectorXd& lower = fitness->space().lower();
    const VectorXd share = Eigen::Map<const VectorXd>(u.data(), lower.size());
    return {(*trace)(*fitness, lower + share.cwiseProduct(fitness->space().upper() - lower))};
  }
};
struct UnitBoxProblem : InUnitBox {
  pagmo::vector_double fitness(const pagmo::vector_double& u) const { return fitness_at(u); }
  std::pair<pagmo::vector_double, pagmo::vector_double> get_bounds() const {
    const auto n = static_cast<std::size_t>(InUnitBox::fitness->space().lower().size());
    return {pagmo::vector_double(n, 0), pagmo::vector_double(n, 1)};
  }
};

struct Method {
  std::string name;
  bool ours = false;
};
const std::vector<Method> methods{{"ours", true}, {"pagmo pso"}, {"pagmo cmaes"}};

/// Evaluations of one run.
std::size_t budget_of(const Options& options) {
  return static_cast<std::size_t>(options.particles) * static_cast<std::size_t>(options.generations + 1);
}

Trace run(const Method& method, const BlsFitness& fitness, const Options& options, std::uint64_t seed) {
  Trace trace;
  if (method.ours) {
    SwarmSettings settings;
    settings.particles = options.particles;
    settings.iterations = options.generations;
    settings.stall = options.generations + 1;  // all methods use the whole budget
    settings.seed = seed;
    Swarm swarm(fitness.space().lower(), fitness.space().upper(), settings);
    while (!swarm.finished()) {
      VectorXd values(options.particles);
      for (Index p = 0; p < values.size(); ++p) values[p] = trace(fitness, swarm.positions().col(p));
      swarm.tell(values);
    }
    return trace;
  }
  UnitBoxProblem problem;
  problem.InUnitBox::fitness = &fitness;
  problem.trace = &trace;
  const auto particles = static_cast<std::size_t>(options.particles);
  for (unsigned start = 0; trace.evaluations() + particles <= budget_of(options); ++start) {
    const auto pagmo_seed = static_cast<unsigned>(seed) + 1000 * start;
    const pagmo::population first{problem, particles, pagmo_seed};
    const auto generations = static_cast<unsigned>((budget_of(options) - trace.evaluations()) / particles);
    if (generations == 0) break;
    pagmo::algorithm algorithm;
    if (method.name == "pagmo pso") {
      pagmo::pso pso{generations};
      pso.set_seed(pagmo_seed);
      algorithm = pagmo::algorithm{pso};
    } else {
      // -1: its own defaults; it ends where it has converged to 1e-6
      algorithm = pagmo::algorithm{
          pagmo::cmaes{generations, -1, -1, -1, -1, 0.5, 1e-6, 1e-6, false, true, pagmo_seed}};  // force_bounds
    }
    algorithm.evolve(first);
  }
  return trace;
}

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

int compare(const Options& options) {
  const Folder folder;
  const fs::path shorter = folder.path() / "shorter";
  const Identified demo_fit = options.duration > 0 ? Identified(demo_of(shorter, options.duration), shorter)
                                                   : Identified(demo / "project.toml", folder.path());
  std::vector<Runs> all;
  std::vector<BlsFitness> fitness;
  std::vector<std::size_t> joints = options.joints;
  if (joints.empty()) {
    joints.resize(demo_fit.fitter->joints());
    std::iota(joints.begin(), joints.end(), std::size_t{1});
  }
  for (const std::size_t joint : joints) {
    if (joint < 1 || joint > demo_fit.fitter->joints()) throw InputError(fmt::format("--joints: no joint {}", joint));
    fitness.emplace_back(*demo_fit.fitter, joint - 1, demo_fit.project.train);
    all.push_back({joint, std::vector(methods.size(), std::vector<Trace>(static_cast<std::size_t>(options.seeds)))});
  }
  const auto seeds = static_cast<std::size_t>(options.seeds);
  const std::size_t budget = budget_of(options);
  Progress progress;
  progress.stage("searching", all.size() * methods.size() * seeds);
  parallel_for(all.size() * methods.size() * seeds, [&](std::size_t i) {
    const std::size_t seed = i % seeds, m = i / seeds % methods.size(), j = i / seeds / methods.size();
    all[j].traces[m][seed] = run(methods[m], fitness[j], options, options.first_seed + seed);
    progress.step();
  });
  progress.done();
  for (Runs& runs : all) {
    for (const auto& traces : runs.traces) {
      for (const Trace& trace : traces) {
        if (trace.evaluations() != budget)
          throw DataError(fmt::format("{} evaluations instead of {}", trace.evaluations(), budget));
        runs.best = std::min(runs.best, trace.after(budget));
      }
    }
  }
  const Table table = table_of(all, budget);
  const std::string text = fmt::format(
      "{} seeds, {} particles, {} generations: {} evaluations a run. J: what the search minimises, share of rated "
      "torque.\n\n{}\nOurs over the better peer, medians, worst joint: J {:.4f} after 25 %, {:.4f} after 50 %, {:.4f} "
      "after 100 %; evaluations to within 1 % of the best {:.2f}.\n",
      options.seeds, options.particles, options.generations, budget, table.text, table.worst.at_quarter,
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
  const Folder folder;
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
      logs->fitter->rows(), samples, logs->fitter->joints(), options.particles, options.generations);
  for (const double most : options.most_nodes) {
    TrainSettings settings = logs->project.train;
    settings.pso = PsoSettings{};
    settings.pso->particles = options.particles;
    settings.pso->iterations = options.generations;
    settings.pso->stall = options.generations + 1;
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
  app.add_option("--particles", options.particles, "of each search")->check(CLI::Range(5, 1000));
  app.add_option("--generations", options.generations, "after the first")->check(CLI::PositiveNumber);
  app.add_option("--duration", options.duration, "of the logs that are compared on [s]; shorter ones take less time")
      ->check(CLI::PositiveNumber);
  app.add_option("--out", options.out, "the table, Markdown");
  app.add_option("--worst-ratio", options.worst_ratio,
                 "fail where our median J, after 25, 50 or 100 %, is more than so many times the better peer's");
  app.add_option("--worst-evaluations", options.worst_evaluations,
                 "the same of the evaluations to within 1 % of the best");
  app.add_flag("--time", options.time, "time the search on long logs instead");
  app.add_option("--rows", options.rows, "of the long logs")->check(CLI::PositiveNumber);
  app.add_option("--most-nodes", options.most_nodes, "upper bounds to time")->delimiter(',');
  CLI11_PARSE(app, argc, argv);
  try {
    return options.time ? time_training(options) : compare(options);
  } catch (const InputError& error) {
    fmt::print(stderr, "swarm_peers: {}\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "swarm_peers: {}\n", error.what());
    return 1;
  }
}
