#pragma once

#include <optional>
#include <vector>

#include "host_tools/identify/excitation.hpp"
#include "host_tools/regression/fitter.hpp"
#include "host_tools/regression/physical.hpp"

namespace fxdyn {

/// What a fit says beside the model. Apart from Estimate, so that who prints it need not know the model.
struct FitFigures {
  /// The physically possible fit, where the project asks for it; the model has its base parameters unless the project
  /// asks for the essential ones.
  std::optional<PhysicalFit> physical;
  std::vector<WeakParameter> weak;             ///< see weak_in_logs()
  double condition = 0;                        ///< of the column-normalised weighted regressor, base and own columns
  std::optional<Fitter::Recursion> recursion;  ///< method rls
};

}  // namespace fxdyn
