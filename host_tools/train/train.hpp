#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "host_tools/identify/fitter.hpp"
#include "host_tools/progress.hpp"

namespace fxdyn {

/// What became of the BLS on one joint.
struct TrainOutcome {
  double error_without = 0, error_with = 0;  ///< held-out RMS of the residual [N*m | N]
  bool kept = false;
  int evaluations = 0;
};

/// Where a search by swarm keeps its last generation, so that a killed run goes on from there. Whoever has written the
/// outcome down removes it.
struct ResumeFile {
  std::filesystem::path path;
  std::string identity;  ///< of everything that the outcome depends on
  std::string inputs;    ///< of project and logs, which are known before the work starts
  /// @throws DataError: there is one, of other inputs
  void check_inputs() const;
};

/// Fits a BLS on every joint together with the structure (joint least squares, ridge on the BLS's coefficients),
/// chooses its hyperparameters by the held-out error, and keeps it only where that falls by at least 5 %. The fitter
/// holds the chosen designs afterwards.
///
/// Without settings.pso a small grid: presliding distance first, then weight scale, nodes and ridge. With it a particle
/// swarm a joint, all generation by generation together, over windows, nodes, ridge, weight scale, presliding distance
/// and its spread, reference velocity. Fitness (paper Eq. 39 and what a drive pays):
///   J = held-out RMS / rated + rounding of the nodes' coefficients / rated + 1e-7 * multiplications
/// The held-out RMS is over all judging trajectories, whole ones: none that was trained on.
/// @throws DataError: the resume file is not of this search
std::vector<TrainOutcome> train(Fitter& fitter, const TrainSettings& settings, Progress& progress,
                                const std::optional<ResumeFile>& resume = std::nullopt);

}  // namespace fxdyn
