#pragma once

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/identify/fit_figures.hpp"
#include "host_tools/identify/gate_data.hpp"
#include "host_tools/identify/options.hpp"

namespace fxdyn {

/// What a fitter's fit comes to.
struct Estimate : FitFigures {
  IdentifiedModel model;  ///< with everything that model.json records
};
/// @throws DataError: the train logs say nothing about some base parameters; names them and the joint to move.
Estimate finish_model(const Fitter& fitter, const Project& project, const GateData& data,
                      const IdentifyOptions& options = {});

}  // namespace fxdyn
