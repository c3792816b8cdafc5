#pragma once

#include <vector>

#include "host_tools/report/diagnosis_result.hpp"

namespace fxdyn::diagnosis {

/// What was found at a joint, and what is left there.
struct JointState {
  bool structured = false;  ///< the model misses something, on the data that fit
  bool remains = false;  ///< it does on the data that judge, so much that it counts, or has another form than its names
  bool established = false;  ///< an effect of its own
  bool reached = false;      ///< an established effect on the robot is felt here
  bool there = false;        ///< an effect is there for sure, under a likely name or as one of two
  bool nameless = false;     ///< .. and no name of it is listed
  bool impacts = false;      ///< shorter than the torque's band shows
  bool wanders = false;      ///< something comes and goes with time
  bool curved = false;       ///< a free curve of the motion closes some of it, on data that did not fit the curve
  bool bends = false;        ///< a link encoder shows a deflection without a name
};
/// Of what is there for sure and what is left. An effect that is only likely is neither.
Verdict verdict_of(const JointState& state);
/// Of a robot: the first of unexplained, partly_explained, explained, not_excited, nothing_missing that a joint has.
Verdict worst(const std::vector<Verdict>& verdicts);

}  // namespace fxdyn::diagnosis
