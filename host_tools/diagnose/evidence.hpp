#pragma once

#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/report/evidence_result.hpp"

namespace fxdyn {

/// What a diagnosis is worth on logs that fitted nothing of it. Test logs decided nothing either; validate logs, in
/// their stead, decided which names stay, and `note` says so.
///
/// joints: RMS of measured minus model torque with the model before and after, both torques filtered alike at the
/// torque cut-off, edges dropped (judge()), over all samples of the logs. The
/// same after, with the torque that the fixed-point firmware would compute: none where it can't be told, and
/// `fixed_point` says why.
///
/// forward: see play_forward().
///
/// Torque-less logs are left out. Without any log the lists are empty and `note` says so.
/// @param still joints that stand still: they have no figures
HeldOutEvidence held_out_evidence(const IdentifiedModel& nominal, const IdentifiedModel& diagnosed,
                                  const std::vector<ProcessedLog>& held_out, const std::vector<bool>& still = {});

}  // namespace fxdyn
