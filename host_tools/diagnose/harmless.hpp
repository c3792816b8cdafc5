#pragma once

#include <vector>

#include "host_tools/diagnose/explore.hpp"
#include "host_tools/diagnose/session_log.hpp"

namespace fxdyn::diagnosis {

/// Where a model harms a joint (harmed_joints()), fits it otherwise:
/// - in the whole band, as the nominal one was: one that was fitted to whitened rows may err more in it wherever the
///   friction is of another form, whatever was found;
/// - only at the joints where something was found, around `nominal`: what is found at one joint makes its rows weigh
///   more in the base parameters that it has in common with others, and these may pay for what it lacks. Not where
///   something was found on the robot, which is all joints'.
/// @returns whether it harms fewer for that; else the outcome stays as it was
bool fit_without_harm(Outcome& outcome, const IdentifiedModel& nominal, const std::vector<SessionLog>& logs);

}  // namespace fxdyn::diagnosis
