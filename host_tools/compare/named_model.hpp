#pragma once

#include "host_tools/effects/forward.hpp"
#include "host_tools/identify/gate_data.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {

// Methods that `fxdyn efficiency` has beside those of `fxdyn compare`, on logs that need not be the project's.

/// What diagnosis names, refitted as `train` does, with the project's prior and without a BLS.
IdentifiedModel named_model(const Project& project, GateData data, Progress& progress);
/// The same with the BLS that `train` adds where it lowers a joint's error.
IdentifiedModel named_and_trained_model(const Project& project, GateData data, Progress& progress);

/// The method `lugre`, with links that are possible bodies.
IdentifiedModel lugre_of_possible_bodies(const Project& project, GateData data, Progress& progress);

}  // namespace fxdyn
