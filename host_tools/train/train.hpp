#pragma once

#include "host_tools/identify/fitter.hpp"
#include "host_tools/progress.hpp"

namespace fxdyn {

/// What became of the BLS on one joint.
struct TrainOutcome {
  double error_without = 0, error_with = 0;  ///< held-out RMS of the residual [N*m | N]
  bool kept = false;
};

/// Fits a BLS on every joint together with the structure (joint least squares, ridge on the BLS's coefficients),
/// chooses presliding distances, weight scale, nodes and ridge by the held-out error, and keeps it only where that
/// falls by at least 5 %. The fitter holds the chosen designs afterwards.
std::vector<TrainOutcome> train(Fitter& fitter, const TrainSettings& settings, Progress& progress);

}  // namespace fxdyn
