#include "host_tools/train/train.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "host_tools/effects/broad_learning_types.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

struct Choice {
  JointFit design;  ///< no BLS: none that was tried is quiet
  Judgement judgement;
  BlsShape shape;
  int generations = 0, evaluations = 0;
  bool quiet = true;
};

/// Presliding distances to choose from, as shares of the joint's range; the state alone has none.
std::vector<double> grid_distances(const TrainSettings& settings) {
  if (settings.inputs == StateInputs::name) return {1e-3};
  return {3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2};
}
constexpr std::array grid_scales{1.0, 3.0};

/// Stribeck velocities to choose from, as shares of the joint's top speed; only bristles have one.
std::vector<double> grid_velocities(const TrainSettings& settings) {
  if (settings.inputs == BristlesInputs::name) return {0.01, 0.1};
  return {};
}

std::vector<Eigen::Index> grid_sizes(const TrainSettings& settings) {
  if (settings.enhancement) return {*settings.enhancement};
  if (settings.nodes) return {*settings.nodes * settings.windows.value_or(1)};
  return {10, 20, 40};
}

/// Of one joint. Its design has no BLS where none is quiet enough.
Choice by_grid(const Fitter& fitter, std::size_t j, const TrainSettings& settings, Progress& progress,
               double nearly_as_good) {
  std::vector<double> ridges{1e-5, 1e-4, 1e-3, 1e-2};
  if (settings.ridge) ridges = {*settings.ridge};
  const std::vector<Eigen::Index> sizes = grid_sizes(settings);
  const Eigen::Index most = *std::max_element(sizes.begin(), sizes.end());
  const BlsDesigner design_of(fitter, j, settings);
  std::vector<Choice> tried;
  std::optional<std::size_t> best;
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
        BlsShape candidate = shape;
        candidate.nodes = counts[s];
        candidate.ridge = ridges[i];
        tried.push_back({design, judgement, candidate});
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
  const double distance = tried[*best].shape.distance;
  for (const double velocity : grid_velocities(settings))
    attempt({.activation = settings.activation, .nodes = middling, .distance = distance, .stribeck = velocity},
            {middling});
  const double velocity = tried[*best].shape.stribeck;
  for (const double scale : grid_scales)
    attempt(
        {.activation = settings.activation, .nodes = most, .scale = scale, .distance = distance, .stribeck = velocity},
        sizes);
  // Of those that are nearly as good, the one with the smallest coefficients: it leans least on its training data.
  const int evaluations = out.evaluations;
  for (const Choice& choice : tried) {
    if (choice.judgement.rmse > nearly_as_good * tried[*best].judgement.rmse) continue;
    if (!out.design.bls || choice.judgement.coefficient_sum < out.judgement.coefficient_sum) out = choice;
  }
  out.evaluations = evaluations;
  return out;
}

std::vector<Choice> by_swarm(const Fitter& fitter, const TrainSettings& settings, Progress& progress,
                             const std::optional<ResumeFile>& resume) {
  const std::size_t n = fitter.joints();
  const PsoSettings& pso = *settings.pso;
  std::vector<Swarm> swarms;
  std::vector<BlsFitness> fitness;
  for (std::size_t j = 0; j < n; ++j) {
    fitness.emplace_back(fitter, j, settings);
    SwarmSettings swarm;
    swarm.particles = pso.particles;
    swarm.iterations = pso.iterations;
    swarm.stall = pso.stall;
    swarm.seed = settings.seed * 1000 + j;
    swarms.emplace_back(fitness[j].space().lower(), fitness[j].space().upper(), swarm);
  }
  search(
      swarms, [&](std::size_t j, const Eigen::VectorXd& x) { return fitness[j](x).value; }, progress, resume);
  std::vector<Choice> chosen(n);
  parallel_for(n, [&](std::size_t j) {
    BlsFitness::Outcome best = fitness[j](swarms[j].best());
    const int generations = swarms[j].generation();
    chosen[j] = {std::move(best.design),
                 std::move(best.judgement),
                 best.shape,
                 generations,
                 generations * pso.particles,
                 best.quiet};
  });
  return chosen;
}

}  // namespace

std::optional<TrainedJoint::Choice> choice_of(const TrainOutcome& outcome) {
  if (!outcome.bls) return {};
  const BroadLearningFit& bls = *outcome.bls;
  TrainedJoint::Choice out;
  out.by = outcome.by;
  out.nodes = outcome.shape.nodes;
  out.windows = outcome.shape.windows;
  out.activation = outcome.shape.activation;
  out.inputs = bls.inputs;
  out.ridge = outcome.shape.ridge;
  out.scale = outcome.shape.scale;
  out.reference_velocity = bls.reference_velocity;
  out.value = outcome.value;
  if (bls.inputs != StateInputs::name) out.distances = {bls.distances.begin(), bls.distances.end()};
  if (bls.inputs == BristlesInputs::name) {
    out.stribeck_velocity = bls.stribeck;
    out.share = bls.share;
  }
  if (outcome.by == "pso") out.generations = outcome.generations;
  return out;
}

std::vector<TrainOutcome> train(Fitter& fitter, const TrainSettings& settings, Progress& progress,
                                const std::optional<ResumeFile>& resume, const TrainOptions& options) {
  const std::size_t n = fitter.joints();
  const std::size_t grid_steps = grid_distances(settings).size() + grid_velocities(settings).size() +
                                 grid_scales.size() * grid_sizes(settings).size();
  const std::size_t steps = settings.pso ? static_cast<std::size_t>(settings.pso->iterations) + 1 : grid_steps;
  progress.stage(settings.pso ? "training the BLS, by particle swarm" : "training the BLS", n * steps);
  const std::vector<Judgement> without = fitter.held_out();
  const std::vector<double> fitted = fitter.fitted_rmse(fitter.estimate());
  std::vector<Choice> chosen(n);
  if (settings.pso) {
    chosen = by_swarm(fitter, settings, progress, resume);
  } else {
    parallel_for(n, [&](std::size_t j) { chosen[j] = by_grid(fitter, j, settings, progress, options.nearly_as_good); });
  }
  std::vector<TrainOutcome> outcomes(n);
  for (std::size_t j = 0; j < n; ++j) {
    const Choice& choice = chosen[j];
    // A fold's structure knows less than that of all logs: its BLS may make up for what the log left out would tell.
    const bool carries_over = fitter.has_validation() || without[j].rmse <= options.carries_over * fitted[j];
    const bool kept =
        choice.design.bls && choice.quiet && carries_over && choice.judgement.beats(without[j], options.worth_keeping);
    outcomes[j] = {.error_without = without[j].rmse,
                   .error_with = choice.judgement.rmse,
                   .kept = kept,
                   .by = settings.pso ? "pso" : "grid",
                   .generations = choice.generations,
                   .evaluations = choice.evaluations,
                   .shape = choice.shape,
                   .value = choice.design.bls ? fitness_of(choice.judgement, choice.design) : 0,
                   .bls = choice.design.bls};
    if (kept) fitter.set_design(j, choice.design);
  }
  progress.done();
  return outcomes;
}

}  // namespace fxdyn
