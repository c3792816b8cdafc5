#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_tools/regression/fitter.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/support/progress.hpp"
#include "host_tools/train/options.hpp"
#include "host_tools/train/search.hpp"
#include "host_tools/train/tuning.hpp"

namespace fxdyn {

/// What became of the BLS on one joint.
struct TrainOutcome {
  double error_without = 0, error_with = 0;  ///< held-out RMS of the residual [N*m | N]
  bool kept = false;
  std::string by;       ///< what chose: pso or grid
  int generations = 0;  ///< of the swarm; grid: 0
  int evaluations = 0;
  BlsShape shape;                       ///< what was chosen, kept or not
  double value = 0;                     ///< its J, see train() [of rated torque]
  std::optional<BroadLearningFit> bls;  ///< the same as scales and weights; none: no candidate was quiet enough
};

/// The choice for metrics.json; none where there is none.
std::optional<TrainedJoint::Choice> choice_of(const TrainOutcome& outcome);

/// Fits a BLS on every joint together with the structure (joint least squares, ridge on the BLS's coefficients),
/// chooses its hyperparameters by the held-out error, and keeps it only where that falls by at least 5 %, and, where
/// train logs judge one another, the structure alone carries over: to within three times its error on those that fit.
/// The fitter holds the chosen designs afterwards.
///
/// Without settings.pso a small grid: presliding distance first, then weight scale, nodes and ridge. With it a particle
/// swarm a joint, all generation by generation together, over windows, nodes, ridge, weight scale, presliding distance
/// and its spread, reference velocity. Fitness (paper Eq. 39 and what a drive pays):
///   J = held-out RMS / rated + rounding of the nodes' coefficients / rated + 1e-7 * multiplications
/// The held-out RMS is over all judging trajectories, whole ones: none that was trained on.
/// @throws DataError: the resume file is not of this search
std::vector<TrainOutcome> train(Fitter& fitter, const TrainSettings& settings, Progress& progress,
                                const std::optional<ResumeFile>& resume = std::nullopt,
                                const TrainOptions& options = {});

}  // namespace fxdyn
