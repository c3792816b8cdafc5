#pragma once

#include <optional>
#include <string>

#include "host_tools/identify/excitation.hpp"
#include "host_tools/identify/gate_data.hpp"
#include "host_tools/identify/options.hpp"
#include "host_tools/regression/fitter.hpp"
#include "host_tools/regression/physical.hpp"

namespace fxdyn {

/// Of the project file and its URDF.
std::string project_hash(const Project& project);

/// What a fitter's fit comes to.
struct Estimate {
  IdentifiedModel model;  ///< with everything that model.json records
  /// The physically possible fit, where the project asks for it; the model has its base parameters unless the project
  /// asks for the essential ones.
  std::optional<PhysicalFit> physical;
  std::vector<WeakParameter> weak;             ///< see weak_in_logs()
  double condition = 0;                        ///< of the column-normalised weighted regressor, base and own columns
  std::optional<Fitter::Recursion> recursion;  ///< method rls
};
/// @throws DataError: the train logs tell nothing of some base parameters; names them and the joint to move.
Estimate finish_model(const Fitter& fitter, const Project& project, const GateData& data,
                      const IdentifyOptions& options = {});

}  // namespace fxdyn
