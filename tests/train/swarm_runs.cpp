#include "tests/train/swarm_runs.hpp"

#include <fmt/format.h>

#include <pagmo/algorithm.hpp>
#include <pagmo/algorithms/cmaes.hpp>
#include <pagmo/algorithms/pso.hpp>
#include <pagmo/population.hpp>
#include <pagmo/problem.hpp>
#include <sstream>

#include "host_tools/support/files.hpp"
#include "host_tools/support/progress.hpp"
#include "host_tools/train/swarm.hpp"

namespace fxdyn::swarm_peers {

namespace fs = std::filesystem;
using Eigen::Index;
using Eigen::VectorXd;
using nlohmann::json;

Identified::Identified(const fs::path& file, const fs::path& directory)
    : project(read_project(file)), data(read_gate_data(project, directory)) {
  Progress progress;
  fitter = identify(project, data, progress);
  progress.done();
}

fs::path demo_of(const fs::path& folder, double duration_s) {
  const fs::path demo = fs::path(FXDYN_SOURCE_DIR) / "host_tools/demo";
  fs::create_directories(folder);
  for (const char* name : {"project.toml", "puma560.urdf"}) write_file(folder / name, read_file(demo / name));
  std::istringstream lines(read_file(demo / "scenario.toml"));
  std::string text;
  for (std::string line; std::getline(lines, line);)
    text +=
        (duration_s > 0 && line.starts_with("duration_s") ? fmt::format("duration_s = {}", duration_s) : line) + "\n";
  write_file(folder / "scenario.toml", text);
  return folder / "project.toml";
}

json Trace::to_json() const {
  json steps = json::array();
  for (const Step& step : steps_) steps.push_back({step.at, step.best});
  return {{"evaluations", evaluations_}, {"best", steps}};
}

Trace Trace::of(const json& file) {
  Trace out;
  out.evaluations_ = file.at("evaluations");
  for (const json& step : file.at("best")) out.steps_.push_back({step.at(0), step.at(1)});
  return out;
}

namespace {

double told(Trace& trace, const BlsFitness& fitness, const VectorXd& x) {
  const double value = fitness(x).value;
  trace.add(value);
  return value;
}

/// The search as pagmo sees it: the box scaled to [0, 1], which its CMA-ES starts from with the same width everywhere.
struct InUnitBox {
  const BlsFitness* fitness = nullptr;
  Trace* trace = nullptr;
  pagmo::vector_double fitness_at(const pagmo::vector_double& u) const {
    const VectorXd& lower = fitness->space().lower();
    const VectorXd share = Eigen::Map<const VectorXd>(u.data(), lower.size());
    return {told(*trace, *fitness, lower + share.cwiseProduct(fitness->space().upper() - lower))};
  }
};
struct UnitBoxProblem : InUnitBox {
  pagmo::vector_double fitness(const pagmo::vector_double& u) const { return fitness_at(u); }
  std::pair<pagmo::vector_double, pagmo::vector_double> get_bounds() const {
    const auto n = static_cast<std::size_t>(InUnitBox::fitness->space().lower().size());
    return {pagmo::vector_double(n, 0), pagmo::vector_double(n, 1)};
  }
};

}  // namespace

Trace run(const Method& method, const BlsFitness& fitness, const Budget& budget, std::uint64_t seed) {
  Trace trace;
  if (method.ours) {
    SwarmSettings settings;
    settings.particles = budget.particles;
    settings.iterations = budget.generations;
    settings.stall = budget.generations + 1;  // all methods use the whole budget
    settings.seed = seed;
    Swarm swarm(fitness.space().lower(), fitness.space().upper(), settings);
    while (!swarm.finished()) {
      VectorXd values(budget.particles);
      for (Index p = 0; p < values.size(); ++p) values[p] = told(trace, fitness, swarm.positions().col(p));
      swarm.tell(values);
    }
    return trace;
  }
  UnitBoxProblem problem;
  problem.InUnitBox::fitness = &fitness;
  problem.trace = &trace;
  const auto particles = static_cast<std::size_t>(budget.particles);
  for (unsigned start = 0; trace.evaluations() + particles <= budget.evaluations(); ++start) {
    const auto pagmo_seed = static_cast<unsigned>(seed) + 1000 * start;
    const pagmo::population first{problem, particles, pagmo_seed};
    const auto generations = static_cast<unsigned>((budget.evaluations() - trace.evaluations()) / particles);
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

}  // namespace fxdyn::swarm_peers
