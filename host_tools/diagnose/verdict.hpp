#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_tools/diagnose/certainty.hpp"
#include "host_tools/diagnose/deflection.hpp"
#include "host_tools/diagnose/gate.hpp"
#include "host_tools/diagnose/impacts.hpp"
#include "host_tools/diagnose/joint_state.hpp"
#include "host_tools/report/diagnosis_result.hpp"

namespace fxdyn::diagnosis {

/// All that a diagnosis came to.
struct Conclusion {
  const IdentifiedModel& nominal;
  const IdentifiedModel& model;  ///< with the effects; what is not believed is not `named`
  const Outcome& outcome;        ///< its problem and features may have been put down
  const Gate& gate;
  std::vector<EffectId> judged;  ///< in the gate's order
  std::vector<double> doubtful;  ///< by joint: share of rows in which its encoder does not tell which way it moves
  const std::vector<Likely>& likely;
  const Deflections& deflections;
  const std::vector<std::optional<Impacts>>& impacts;
  const std::vector<std::optional<CurveResult>>& curves;  ///< by joint
  const std::vector<bool>& still;
  const std::vector<ProcessedLog>& now;   ///< train and validate
  const std::vector<ProcessedLog>& test;  ///< for figures only
};

/// Of a problem, for a conclusion that outlives it.
std::vector<EffectId> judged_by(const Gate& gate, const Linearised& problem);
std::vector<double> doubtful_shares(const Linearised& problem);

/// What judged the names.
std::string gate_of(const std::vector<ProcessedLog>& now);
/// The answer; its notes are those that the figures ask for.
DiagnosisResult verdicts(const Conclusion& conclusion);

}  // namespace fxdyn::diagnosis
