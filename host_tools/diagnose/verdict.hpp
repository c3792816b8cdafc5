#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "host_tools/diagnose/deflection.hpp"
#include "host_tools/diagnose/gate.hpp"
#include "host_tools/diagnose/jolts.hpp"
#include "host_tools/effects/identified_model.hpp"

namespace fxdyn::diagnosis {

/// All that a diagnosis came to.
struct Conclusion {
  const IdentifiedModel& nominal;
  const IdentifiedModel& model;  ///< with the effects; what is not believed is not `named`
  const Outcome& outcome;
  const Gate& gate;
  const Deflections& deflections;
  const std::vector<std::optional<Jolts>>& jolts;
  const std::vector<bool>& still;
  const std::vector<ProcessedLog>& now;   ///< train and validate
  const std::vector<ProcessedLog>& test;  ///< for figures only
};

/// What judged the names.
std::string gate_of(const std::vector<ProcessedLog>& now);
/// Nominal parameters that changed since the healthy session by more than sessions differ, one line each; and a line
/// where half of the joints have such ones beside a changed load or tilt: that may be another robot.
std::vector<std::string> changed_parameters(const Linearised& at);
/// Effects of the healthy session, no friction, that are not today what they were then: by more than sessions differ.
std::vector<EffectCandidate> changed_effects(const Linearised& at);
/// diagnosis.json; its notes are those that the figures ask for.
nlohmann::json verdicts(const Conclusion& told);

}  // namespace fxdyn::diagnosis
