#include "host_tools/train/train.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/error.hpp"
#include "host_tools/files.hpp"
#include "host_tools/parallel.hpp"
#include "host_tools/train/swarm.hpp"
#include "host_tools/train/tuning.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

constexpr double worth_keeping = 0.05;
constexpr double nearly = 1.05;

struct Choice {
  JointFit design;
  Judgement judgement;
  int evaluations = 0;
};

/// Presliding distances to choose from, as shares of the joint's range; the state alone has none.
std::vector<double> grid_distances(const TrainSettings& settings) {
  if (settings.inputs == StateInputs::name) return {1e-3};
  return {3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2};
}
constexpr std::array grid_scales{1.0, 3.0};

std::vector<Eigen::Index> grid_sizes(const TrainSettings& settings) {
  if (settings.enhancement) return {*settings.enhancement};
  if (settings.nodes) return {*settings.nodes * settings.windows.value_or(1)};
  return {10, 20, 40};
}

/// Of one joint. Its design has no BLS where none is quiet enough.
Choice by_grid(const Fitter& fitter, std::size_t j, const TrainSettings& settings, Progress& progress) {
  std::vector<double> ridges{1e-5, 1e-4, 1e-3, 1e-2};
  if (settings.ridge) ridges = {*settings.ridge};
  const std::vector<Eigen::Index> sizes = grid_sizes(settings);
  const Eigen::Index most = *std::max_element(sizes.begin(), sizes.end());
  const BlsDesigner design_of(fitter, j, settings);
  std::vector<Choice> tried;
  std::optional<std::size_t> best;
  std::vector<double> distance_of;
  Choice out;
  const auto attempt = [&](const BlsShape& shape, const std::vector<Eigen::Index>& counts) {
    const JointFit largest = design_of(shape);
    const auto judgements = fitter.held_out_with(j, largest, counts, ridges);
    for (std::size_t s = 0; s < counts.size(); ++s) {
      JointFit design = first_nodes(largest, counts[s]);
      for (std::size_t i = 0; i < ridges.size(); ++i) {
        const Judgement& judgement = judgements[s][i];
        ++out.evaluations;
        if (!is_quiet(judgement, design.rated_torque)) continue;
        design.bls->ridge = ridges[i];
        tried.push_back({design, judgement});
        distance_of.push_back(shape.distance);
        if (!best || judgement.rmse < tried[*best].judgement.rmse) best = tried.size() - 1;
      }
      progress.step();
    }
  };
  const Eigen::Index middling = sizes[sizes.size() / 2];
  // The presliding distance matters most: it is chosen with a middling network, the network with that distance.
  for (const double share : grid_distances(settings))
    attempt({.activation = settings.activation, .nodes = middling, .distance = share}, {middling});
  if (!best) return out;
  const double distance = distance_of[*best];
  for (const double scale : grid_scales)
    attempt({.activation = settings.activation, .nodes = most, .scale = scale, .distance = distance}, sizes);
  // Of those that are nearly as good, the one with the smallest coefficients: it leans least on its training data.
  const int evaluations = out.evaluations;
  for (const Choice& choice : tried) {
    if (choice.judgement.rmse > nearly * tried[*best].judgement.rmse) continue;
    if (!out.design.bls || choice.judgement.coefficient_sum < out.judgement.coefficient_sum) out = choice;
  }
  out.evaluations = evaluations;
  return out;
}

void save(const ResumeFile& file, const std::vector<Swarm>& swarms) {
  json state = {
      {"schema", "fxdyn.pso/1"}, {"identity", file.identity}, {"inputs", file.inputs}, {"swarms", json::array()}};
  for (const Swarm& swarm : swarms) state["swarms"].push_back(swarm.to_json());
  write_file(file.path, state.dump() + "\n");
}

DataError of_another(const ResumeFile& file) {
  return DataError(fmt::format(
      "{}: the generations in it are of another project, other logs or other settings; remove it to start anew",
      file.path.string()));
}

/// Calls read(state) with what the file holds, if there is one.
template <class Read>
void with_state(const ResumeFile& file, Read&& read) {
  if (!std::filesystem::exists(file.path)) return;
  try {
    const json state = json::parse(read_file(file.path));
    if (state.at("schema") != "fxdyn.pso/1" || state.at("inputs") != file.inputs) throw of_another(file);
    read(state);
  } catch (const json::exception&) {
    throw DataError(
        fmt::format("{}: not a generation of a search, or cut off; remove it to start anew", file.path.string()));
  } catch (const InputError&) {
    throw of_another(file);
  }
}

void load(const ResumeFile& file, std::vector<Swarm>& swarms) {
  with_state(file, [&](const json& state) {
    if (state.at("identity") != file.identity || state.at("swarms").size() != swarms.size()) throw of_another(file);
    for (std::size_t j = 0; j < swarms.size(); ++j) swarms[j].from_json(state["swarms"][j]);
  });
}

/// All joints, generation by generation: with few joints left the particles still fill all cores.
std::vector<Choice> by_swarm(const Fitter& fitter, const TrainSettings& settings, Progress& progress,
                             const std::optional<ResumeFile>& resume) {
  const std::size_t n = fitter.joints();
  const PsoSettings& pso = *settings.pso;
  std::vector<Swarm> swarms;
  std::vector<BlsFitness> fitness;
  for (std::size_t j = 0; j < n; ++j) {
    SwarmSettings swarm;
    swarm.particles = pso.particles;
    swarm.iterations = pso.iterations;
    swarm.stall = pso.stall;
    swarm.seed = settings.seed * 1000 + j;
    fitness.emplace_back(fitter, j, settings);
    swarms.emplace_back(fitness[j].space().lower(), fitness[j].space().upper(), swarm);
  }
  if (resume) load(*resume, swarms);
  const auto particles = static_cast<std::size_t>(pso.particles);
  for (const Swarm& swarm : swarms) {
    for (int k = 0; k < swarm.generation(); ++k) progress.step();
  }
  for (;;) {
    std::vector<std::size_t> busy;
    for (std::size_t j = 0; j < n; ++j) {
      if (!swarms[j].finished()) busy.push_back(j);
    }
    if (busy.empty()) break;
    std::vector<Eigen::VectorXd> values(n, Eigen::VectorXd(pso.particles));
    parallel_for(busy.size() * particles, [&](std::size_t i) {
      const std::size_t j = busy[i / particles];
      const auto p = static_cast<Eigen::Index>(i % particles);
      values[j][p] = fitness[j](swarms[j].positions().col(p)).value;
    });
    for (const std::size_t j : busy) {
      swarms[j].tell(values[j]);
      progress.step();
    }
    if (resume) save(*resume, swarms);
  }
  std::vector<Choice> chosen(n);
  parallel_for(n, [&](std::size_t j) {
    BlsFitness::Outcome best = fitness[j](swarms[j].best());
    if (!best.quiet) best.design.bls.reset();
    chosen[j] = {std::move(best.design), std::move(best.judgement), swarms[j].generation() * pso.particles};
  });
  return chosen;
}

}  // namespace

void ResumeFile::check_inputs() const {
  with_state(*this, [](const json&) {});
}

std::vector<TrainOutcome> train(Fitter& fitter, const TrainSettings& settings, Progress& progress,
                                const std::optional<ResumeFile>& resume) {
  const std::size_t n = fitter.joints();
  const std::size_t grid_steps = grid_distances(settings).size() + grid_scales.size() * grid_sizes(settings).size();
  const std::size_t steps = settings.pso ? static_cast<std::size_t>(settings.pso->iterations) + 1 : grid_steps;
  progress.stage(settings.pso ? "training the BLS, by particle swarm" : "training the BLS", n * steps);
  const std::vector<Judgement> without = fitter.held_out();
  std::vector<Choice> chosen(n);
  if (settings.pso) {
    chosen = by_swarm(fitter, settings, progress, resume);
  } else {
    parallel_for(n, [&](std::size_t j) { chosen[j] = by_grid(fitter, j, settings, progress); });
  }
  std::vector<TrainOutcome> outcomes(n);
  for (std::size_t j = 0; j < n; ++j) {
    const bool kept = chosen[j].design.bls && chosen[j].judgement.beats(without[j], worth_keeping);
    outcomes[j] = {without[j].rmse, chosen[j].judgement.rmse, kept, chosen[j].evaluations};
    if (kept) fitter.set_design(j, chosen[j].design);
  }
  progress.done();
  return outcomes;
}

}  // namespace fxdyn
