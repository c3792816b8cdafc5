#pragma once

#include <filesystem>

#include "host_tools/effects/forward.hpp"
#include "host_tools/regression/fitter.hpp"

namespace fxdyn {

/// Information of the logs that a model was trained on about its coefficients: where `fxdyn update` goes on. In
/// DIR/information.cbor.
struct StoredInformation {
  std::vector<std::string> unknowns;  ///< Fitter::unknowns(): which coefficients, in which order
  Eigen::VectorXd weights;            ///< of a row of each joint: one over the variance of what the model leaves over
  double row_interval_s = 0;          ///< between the rows of one log
  bool fits_drift = false;            ///< drift is among the unknowns: every log began cold
  SquareRootInformation information;
};

/// Of the fitter's train logs, as they made the model that has these coefficients.
StoredInformation stored_information(const Fitter& fitter);

/// Coefficients in the order of Fitter::unknowns(), from a model and its joints with what the Fitter fits
/// (KeptEffects::design(), and the BLS).
Eigen::VectorXd coefficients_of(const IdentifiedModel& model, const std::vector<JointFit>& design);

void write_information(const StoredInformation& stored, const IdentifiedModel& model,
                       const std::filesystem::path& directory);
/// @throws InputError: it is missing, not whole or of another model than this one; says which command makes it.
StoredInformation read_information(const IdentifiedModel& model, const std::filesystem::path& directory);

}  // namespace fxdyn
