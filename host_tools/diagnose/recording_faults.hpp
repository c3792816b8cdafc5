#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_tools/diagnose/explore.hpp"

namespace fxdyn::diagnosis {

/// What may be wrong with a recording, not with the robot. Each explains today's logs by few parameters and competes
/// with the effects that the search found:
/// - a joint's encoder slipped since the baseline: its zero is elsewhere in today's logs;
/// - position and torque of a log have two clocks: the lag between them grows;
/// - one log of several was recorded with another load, or another gain of a joint's torque.
struct RecordingFault {
  std::string complaint;  ///< what it is, and what to do
  double score = 0;       ///< 2 ln likelihood - k ln N, more than the nominal model's
  double closure = 0;     ///< share of what any function of the state explains of today's logs
  /// score; the same of what a sound recording may show in its place: that load or gain in all of today's logs; a joint
  /// whose friction is another in that log, as it is where the model's friction does not fit that motion; for a slip a
  /// tilt or load of the robot
  double sound_score = 0;
};

/// All of them, the best first.
/// @param nominal without named effects
std::vector<RecordingFault> recording_faults(const Models& nominal, const std::vector<SessionLog>& logs,
                                             const std::vector<Eigen::VectorXd>& whitening);

/// The fault that explains today's logs better than what the search found, and leaves little; none.
std::optional<RecordingFault> likely_recording_fault(const Models& nominal, const std::vector<SessionLog>& logs,
                                                     const Outcome& outcome);

}  // namespace fxdyn::diagnosis
