#pragma once

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/regression/physical.hpp"

namespace fxdyn {

/// A model whose links are possible bodies, and those bodies.
struct PossibleModel {
  IdentifiedModel model;
  PhysicalFit bodies;
};

/// The possible model that the train logs tell apart least from `model`, where they decide nothing the prior's bodies:
///   minimise (x - x0)^T X^T W X (x - x0) / variance + sum_i D(P_i || P0_i),   x = [base parameters; coefficients]
/// with x0 the model's own (fit_physical()). A model that possible bodies have stays as it is, bit by bit. Effects that
/// no column stands for (KeptEffects) stay in any case.
/// @param logs that the model was made from; must not change meanwhile
PossibleModel possible_model(const Project& project, const IdentifiedModel& model,
                             const std::vector<ProcessedLog>& logs);

}  // namespace fxdyn
