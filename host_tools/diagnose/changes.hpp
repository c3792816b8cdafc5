#pragma once

#include <string>
#include <vector>

#include "host_tools/diagnose/linearised.hpp"

namespace fxdyn::diagnosis {

/// Nominal parameters that changed since the healthy session by more than sessions differ, one line each; and a line
/// where half of the joints have such ones beside a changed load or tilt: that may be another robot.
std::vector<std::string> changed_parameters(const Linearised& problem);
/// Effects of the healthy session, no friction, that are not today what they were then: by more than sessions differ.
std::vector<EffectCandidate> changed_effects(const Linearised& problem);

}  // namespace fxdyn::diagnosis
