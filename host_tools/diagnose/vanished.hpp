#pragma once

#include <optional>

#include "host_tools/diagnose/explore.hpp"

namespace fxdyn::diagnosis {

/// Whether an effect at a joint makes no torque (RMS of the rows, 1e-6 of rated): a fit has taken its coefficients to
/// where their bounds are. What judges an effect is linear, and knows no bounds.
/// @param group of the effect, in the problem's model; @param fit its coefficients
bool is_at_nothing(const Linearised& problem, const Group& group, const EffectFit& fit);

/// A finding at a joint that is at nothing in the model that is written. None: all are something.
std::optional<EffectId> vanished_finding(const Outcome& outcome, const IdentifiedModel& written);

}  // namespace fxdyn::diagnosis
