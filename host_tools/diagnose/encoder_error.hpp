#pragma once

#include <optional>

#include "host_tools/regression/dataset.hpp"

namespace fxdyn::diagnosis {

/// Sees a robot through a log's encoders once more. It moves like the log below twice the frequency of its motion (0.4
/// of the torque's cut-off, see choose_filter()), where a slow joint's steps are no longer stairs. The log's positions
/// become that motion with the error of rounding it to the steps, filtered as the recording was. The torque stays.
/// @returns how it moves; nothing (and nothing changes) where no encoder has a step, or the velocities are measured
std::optional<MotionRows> see_again(ProcessedLog& log);

}  // namespace fxdyn::diagnosis
