#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_tools/diagnose/linearised.hpp"
#include "host_tools/diagnose/options.hpp"
#include "host_tools/effects/forward.hpp"
#include "host_tools/effects/session.hpp"
#include "host_tools/identify/identify.hpp"

namespace fxdyn::diagnosis {

/// The logs with their ages, decimated to what the torque's band needs, very long ones in windows; and the session that
/// those of today belong to: one where no two windows overlap in time and no pause is long, else every log starts its
/// own.
/// @param now train and validate logs @param before the healthy session's
std::vector<SessionLog> sessions(const std::vector<ProcessedLog>& now, const std::vector<ProcessedLog>& before,
                                 std::optional<Session>& session, const SessionOptions& options);

/// For people: that windows of the logs are searched; none: they are whole.
std::vector<std::string> note_of_windows(const std::vector<SessionLog>& logs, const SessionOptions& options);

/// @throws DataError: train logs or the baseline are too short to fit anything; without a log that judges and with one
/// trajectory only, its blocks have to, and are too short for that
void check_lengths(const std::vector<SessionLog>& logs, const SessionOptions& options);

/// Joints that this motion says nothing of: they stand still, or as good as, beside what the encoder's noise looks
/// like.
std::vector<bool> still_joints(const GateData& data, const SessionOptions& options);

/// @throws DataError: a joint that moves today rests in the baseline. That leaves open what its links weigh, and the
/// gap would show at other joints.
void check_baseline_moves(const Robot& robot, const GateData& data, const std::vector<ProcessedLog>& baseline);

/// Keeps joints out of the fit. Where one stands still its encoder's noise is no motion.
void leave_out(std::vector<ProcessedLog>& logs, const std::vector<bool>& joints);

/// A joint that stands still holds any torque up to its stiction: what was measured says nothing. The model's own
/// torque takes its place, under so much white noise that the joint counts next to nothing in what all joints share.
void mute(std::vector<SessionLog>& logs, const IdentifiedModel& model, const std::vector<bool>& joints,
          const SessionOptions& options);

/// By joint: the largest structural torque of the logs [N*m | N].
std::vector<double> largest_loads(const Models& models, const std::vector<SessionLog>& logs);
/// By joint: a sign of the velocity that is narrower [rad/s | m/s] does not show. What the encoder's noise makes of the
/// velocity, in the log where it is least, and narrowest_sign of the largest speed; where the velocity is measured the
/// latter alone.
std::vector<double> least_widths(const std::vector<SessionLog>& logs);

/// Base parameters of the baseline with friction, load and tilt of their own against what both sessions measured.
/// @returns a note for each joint at which nothing explains both @throws DataError: at half of the joints
std::vector<std::string> check_same_robot(Models models, const std::vector<SessionLog>& logs,
                                          const std::vector<bool>& still);

/// A validate or test log that has the train logs' torque times some factor at a joint: other units.
/// @returns a note for each such joint @throws DataError: it is so at every joint
std::vector<std::string> check_judges(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs,
                                      const std::vector<bool>& still, const SessionOptions& options);

}  // namespace fxdyn::diagnosis
