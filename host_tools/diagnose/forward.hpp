#pragma once

#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/report/evidence_result.hpp"

namespace fxdyn {

/// The recorded motion of the longest log (at most its first 20 s) played through the simulator in closed loop, on a
/// plant that is the model before and on one that is the model after. The controller is the recorded torque (filtered
/// at the torque cut-off, at the times of the motion) as feedforward plus a PD that follows the recorded motion:
///
///     tau = tau_recorded + PD(q_recorded - q, dq_recorded - dq)
///
/// Effects that change the measured torque rather than the motion (torque_gain, delay, saturation) or that bend the
/// gear (elasticity, backlash, eccentricity) are no part of the simulated plant; what they contribute along the
/// recorded motion is taken out of tau_recorded.
///
/// A plant that is the robot would follow by itself. So what the PD has to add, and what remains of the position error,
/// is the plant's share that is still wrong: per joint the RMS of q - q_recorded [rad | m] and, filtered like the log,
/// of tau - tau_recorded [N*m | N], without the first second, in which the loop settles. A plant that fails has no
/// figures, and `failed_before` or `failed_after` says why.
/// @param logs with torque; at least one
PlayedForward play_forward(const IdentifiedModel& nominal, const IdentifiedModel& diagnosed,
                           const std::vector<const ProcessedLog*>& logs);

}  // namespace fxdyn
