#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn {

/// What a diagnosis is worth on logs that fitted nothing of it: the key "evidence" of diagnosis.json. Test logs decided
/// nothing either; validate logs, in their stead, decided which names stay, and "note" says so.
///
/// joints: RMS of measured minus model torque with the model before and after, both torques filtered alike at the
/// torque cut-off, edges dropped (judge()), over all samples of the logs. The
/// same after, with the torque that the fixed-point firmware would compute. null where it can't be told; "fixed_point"
/// then says why.
///
/// forward: see forward_json().
///
/// Torque-less logs are left out. Without any log the lists are empty and "note" says so.
/// @param still joints that stand still: their figures are null
nlohmann::json evidence_json(const IdentifiedModel& nominal, const IdentifiedModel& diagnosed,
                             const std::vector<ProcessedLog>& held_out, const std::vector<bool>& still = {});

}  // namespace fxdyn
