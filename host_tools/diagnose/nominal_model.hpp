#pragma once

#include "host_tools/effects/forward.hpp"
#include "host_tools/identify/identify.hpp"

namespace fxdyn::diagnosis {

/// The structural model with nominal effects only, fitted to the logs of `data`, which gets notes. What bends is no
/// part of it: that is found with its rivals.
/// @param healthy a torque column that comes late is how this robot's signals are sampled, else it is an effect with a
/// name @throws DataError as identify() does
IdentifiedModel nominal_model(Project project, GateData& data, bool healthy, Progress& progress);

/// What is known of the train logs, with other logs in their place: those may fill the memory.
GateData with_other_logs(const GateData& data, std::vector<ProcessedLog> logs);

}  // namespace fxdyn::diagnosis
