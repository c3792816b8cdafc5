#pragma once

#include <optional>
#include <vector>

#include "host_tools/diagnose/gate.hpp"
#include "host_tools/report/diagnosis_result.hpp"

namespace fxdyn::diagnosis {

/// By joint, of what is left without a name.
using Curves = std::vector<std::optional<CurveResult>>;
bool is_any(const Curves& curves);

EffectFit& effect_of(IdentifiedModel& model, const EffectId& id);

/// What is there for sure stays as a column without a name where its name is not: its torque is measured all the same.
void mark_named(IdentifiedModel& model, const Outcome& outcome);

/// The models with what is likely only as what is established.
Models with_findings(const Outcome& outcome);

/// Takes what wanders with time (TimeCurves) off the torques of the logs, at joints that have no curve of the motion.
/// It passes for noise that remembers, hides effects, and gets names of others. @returns its curves
Curves take_off_what_wanders(const Outcome& outcome, const Gate& gate, const std::vector<bool>& still,
                             std::vector<SessionLog>& logs);

/// What is left without a name gets a curve, by joint. It says which variable, and where: of time, as it was taken off,
/// or of the motion (add_free_curves()) where structure is left, or suspected at a joint without a name.
Curves curves_of_the_rest(const Outcome& outcome, const Gate& gate, const std::vector<bool>& still,
                          const Curves& wandering, const std::vector<SessionLog>& logs);

/// Whether a curve may be in the model: one of the motion, whose variable is sure where no validate log judges it by
/// another motion.
bool may_enter(const CurveResult& curve, const std::vector<SessionLog>& logs, const GateOptions& options);

}  // namespace fxdyn::diagnosis
