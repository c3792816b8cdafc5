#pragma once

#include <optional>
#include <vector>

#include "host_tools/check/options.hpp"
#include "host_tools/identify/torque_samples.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn {

/// Torque that was recorded at other times than the motion.
struct TorqueLead {
  double seconds = 0;            ///< torque ahead of the motion: [signals] torque_lead_s
  double before = 0, after = 0;  ///< share of the torque's RMS that is not explained, mean of the joints that move
  double nats = 0;               ///< gained
};
/// The shift that explains the torque best, where it gains `gain` and is longer than `least_lead_s`: shorter ones
/// belong to identify, which finds them by itself.
std::optional<TorqueLead> find_long_torque_lead(const Project& project, const std::vector<ProcessedLog>& logs,
                                                const ArrangementOptions& options);

/// Minus the log of the evidence of a torque that is `seconds` ahead of the motion, up to a constant that all shifts
/// share.
double torque_lead_nats(const Project& project, const std::vector<ProcessedLog>& logs, double seconds,
                        const ArrangementOptions& options);

struct MeasuredLead {
  double seconds = 0;     ///< torque ahead of the motion
  double resolution = 0;  ///< [s] a shift by that raises what stays unexplained (squared) by the share `blurred`
};
/// How far the torque is ahead of the motion: the vertex of a parabola through what stays unexplained (squared) at
/// three shifts, `least_lead_s` apart; good to a quarter of that. None: too few samples, or the middle one is not the
/// best.
std::optional<MeasuredLead> torque_lead(const Project& project, const std::vector<ProcessedLog>& logs,
                                        const ArrangementOptions& options);

/// Whether the URDF leaves most of a joint's torque in the train logs unexplained.
bool is_unexplained(const Project& project, const std::vector<ProcessedLog>& logs, const ArrangementOptions& options);

/// How badly a log and the train logs are explained together: it needs other bodies, or has other columns. The train
/// logs' residual grows where both are fitted as one, with as many samples of each: by that factor, at the joint where
/// it grows most; 1: not at all, or too few samples.
double disagreement(const Robot& robot, const TorqueSamples& train, const TorqueSamples& log,
                    const ArrangementOptions& options);

/// Whether positions stand in the torque's columns and torques in the position's: the exchanged columns are explained
/// by the URDF, the given ones are not.
bool are_exchanged(const Project& project, const std::vector<Log>& train, const ArrangementOptions& options);

}  // namespace fxdyn
