#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_tools/diagnose/certainty.hpp"
#include "host_tools/diagnose/deflection.hpp"
#include "host_tools/diagnose/diagnosis_result.hpp"
#include "host_tools/diagnose/gate.hpp"
#include "host_tools/diagnose/impacts.hpp"

namespace fxdyn::diagnosis {

/// All that a diagnosis came to.
struct Conclusion {
  const IdentifiedModel& nominal;
  const IdentifiedModel& model;  ///< with the effects; what is not believed is not `named`
  const Outcome& outcome;
  const Gate& gate;
  const std::vector<Likely>& likely;
  const Deflections& deflections;
  const std::vector<std::optional<Impacts>>& impacts;
  const std::vector<bool>& still;
  const std::vector<ProcessedLog>& now;   ///< train and validate
  const std::vector<ProcessedLog>& test;  ///< for figures only
};

/// What was found at a joint, and what is left there.
struct JointState {
  bool structured = false;   ///< the model misses something, on the data that fit
  bool remains = false;      ///< .. and it counts on the data that judge
  bool established = false;  ///< an effect of its own
  bool reached = false;      ///< an established effect on the robot is felt here
  bool there = false;        ///< an effect is there for sure, and its name is not established
  bool likely = false;       ///< effects that are not sure enough for the model
  bool impacts = false;      ///< shorter than the torque's band shows
  bool bends = false;        ///< a link encoder shows a deflection without a name
};
Verdict verdict_of(const JointState& state);
/// Of a robot: the first of unexplained, partly_explained, explained, not_excited, nothing_missing that a joint has.
Verdict worst(const std::vector<Verdict>& verdicts);

/// What judged the names.
std::string gate_of(const std::vector<ProcessedLog>& now);
/// The answer; its notes are those that the figures ask for.
DiagnosisResult verdicts(const Conclusion& conclusion);

}  // namespace fxdyn::diagnosis
