#include "host_tools/train/train.hpp"

#include <cmath>

#include "host_tools/parallel.hpp"
#include "host_tools/random.hpp"
#include "model/broad_learning.hpp"

namespace fxdyn {
namespace {

constexpr double worth_keeping = 0.05;
constexpr double nearly = 1.05;

/// The nodes of fixed point are off by up to 4e-5 (model/dense.hpp), and by a tenth of that on the average:
/// coefficients that add up to more than this many times the rated torque would show.
constexpr double largest_sum = 20;

struct Choice {
  JointFit design;
  Judgement judgement;
};

/// Weights lie on a grid that every format of theirs holds, so that fixed point does not change them.
constexpr double weight_grid = 512;

/// Random feature weights (paper Eqs. 23 and 25), drawn once: fewer nodes are the first rows of more.
Eigen::MatrixXd random_weights(std::uint64_t seed, Eigen::Index nodes, double scale) {
  Random random(seed);
  const auto inputs = static_cast<Eigen::Index>(BroadLearningLayout::inputs);
  Eigen::MatrixXd weights(nodes, inputs + 1);
  for (Eigen::Index k = 0; k < nodes; ++k) {
    for (Eigen::Index i = 0; i <= inputs; ++i) weights(k, i) = scale * random.uniform(-1, 1);
    weights(k, 0) *= 1.5;  // half of what the velocity's curve spans
  }
  return (weights * weight_grid).array().round() / weight_grid;
}

double span(const Fitter& fitter, std::size_t joint) {
  double low = 1e300, high = -1e300;
  for (const ProcessedLog& log : fitter.logs()) {
    low = std::min(low, log.q.col(static_cast<Eigen::Index>(joint)).minCoeff());
    high = std::max(high, log.q.col(static_cast<Eigen::Index>(joint)).maxCoeff());
  }
  return high - low;
}

double top_speed(const Fitter& fitter, std::size_t joint) {
  double top = 0;
  for (const ProcessedLog& log : fitter.logs())
    top = std::max(top, log.joint_motion(static_cast<Eigen::Index>(joint)).dq.cwiseAbs().maxCoeff());
  return top;
}

}  // namespace

std::vector<TrainOutcome> train(Fitter& fitter, const TrainSettings& settings, Progress& progress) {
  const std::size_t n = fitter.joints();
  std::vector<double> ridges{1e-5, 1e-4, 1e-3, 1e-2};
  if (settings.ridge) ridges = {*settings.ridge};
  std::vector<Eigen::Index> sizes{10, 20, 40};
  if (settings.nodes) sizes = {*settings.nodes * settings.windows.value_or(1)};
  const std::vector<double> scales{1.0, 3.0};
  const std::vector<double> distances{3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2};  // of the joint's range
  const std::size_t candidates = distances.size() + scales.size() * sizes.size();

  progress.stage("training the BLS", n * candidates);
  const std::vector<Judgement> without = fitter.held_out();
  std::vector<Choice> chosen(n);
  parallel_for(n, [&](std::size_t j) {
    std::vector<Choice> tried;
    const Choice* best = nullptr;
    tried.reserve(candidates * ridges.size());
    const double range = span(fitter, j);
    JointFit design = fitter.design(j);
    BroadLearningFit bls;
    // fixed point's asinh ends at 128
    bls.reference_velocity = std::max(0.02 * top_speed(fitter, j), design.dq_limit / 120);
    bls.span = std::asinh(std::max(top_speed(fitter, j), design.dq_limit) / bls.reference_velocity);
    const auto attempt = [&](double distance, double scale, Eigen::Index nodes) {
      bls.distances = {distance / 3, distance, distance * 3};
      bls.weights = random_weights(settings.seed * 100 + j, nodes, scale);
      design.bls = bls;
      const std::vector<Judgement> judgements = fitter.held_out_with(j, design, ridges);
      for (std::size_t i = 0; i < judgements.size(); ++i) {
        if (judgements[i].coefficient_sum > largest_sum * design.rated_torque) continue;
        tried.push_back({design, judgements[i]});
        tried.back().design.bls->ridge = ridges[i];
        if (best == nullptr || judgements[i].rmse < best->judgement.rmse) best = &tried.back();
      }
      progress.step();
    };
    // The presliding distance matters most: it is chosen with a middling network, the network with that distance.
    for (const double share : distances) attempt(share * range, 1.0, sizes[sizes.size() / 2]);
    if (best == nullptr) return;  // none whose coefficients are small enough
    const double distance = best->design.bls->distances[1];
    for (const double scale : scales) {
      for (const Eigen::Index nodes : sizes) attempt(distance, scale, nodes);
    }
    // Of those that are nearly as good, the one with the smallest coefficients: it leans least on its training data.
    for (const Choice& choice : tried) {
      if (choice.judgement.rmse > nearly * best->judgement.rmse) continue;
      if (!chosen[j].design.bls || choice.judgement.coefficient_sum < chosen[j].judgement.coefficient_sum)
        chosen[j] = choice;
    }
  });

  std::vector<TrainOutcome> outcomes(n);
  for (std::size_t j = 0; j < n; ++j) {
    outcomes[j] = {without[j].rmse, chosen[j].judgement.rmse, chosen[j].judgement.beats(without[j], worth_keeping)};
    if (outcomes[j].kept) fitter.set_design(j, chosen[j].design);
  }
  progress.done();
  return outcomes;
}

}  // namespace fxdyn
