#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/check/arrangement.hpp"

namespace fxdyn {

/// What may be wrong with the columns or the URDF.
enum class Mistake {
  swapped_joints,   ///< all columns of two joints
  swapped_motion,   ///< their motion alone
  swapped_torques,  ///< their torques alone
  mirrored_motion,  ///< q runs against the URDF's axis, the torque does not
  mirrored_torque,  ///< the torque alone
  mirrored_joint,   ///< both
  zero,             ///< q has another zero
  axis,             ///< the URDF's axis
  gravity,          ///< its direction
  torque_gain,
  torque_unit,  ///< one gain for all joints: currents, or the URDF's masses are placeholders
  position_unit,
  spring  ///< no mistake, but a torque over the joint's position that may look like one
};
std::string to_string(Mistake mistake);

/// A change of one thing that explains the torques better.
struct ArrangementMove {
  Mistake mistake{};
  Eigen::Index joint = 0, other = 0;                    ///< `other` of the swaps
  double value = 0;                                     ///< offset [rad | m], gain, unit
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< axis, gravity
  Arrangement result;                                   ///< with all moves before it
  double nats = 0;                                      ///< gained
};

struct ArrangementFinding {
  Arrangement from;  ///< what it was compared with: all moves before it, and springs
  ArrangementMove move;
  Eigen::Index felt = 0;                ///< the joint whose error falls most
  double before = 0, after = 0;         ///< RMS error of that joint [N*m | N]
  std::vector<ArrangementMove> others;  ///< explanations that the data can't exclude, the best first
};

/// The changes that explain the torques better than what the project says, each beside those before it, one by one
/// while that gains `options.gain`. A joint may have a spring or a gravity compensator: where that explains most it is
/// taken in, and only what another change explains beyond it counts. Empty where nothing is wrong, or where there are
/// too few samples.
/// @param columns_only of one log of several: axes and gravity are the robot's
std::vector<ArrangementFinding> find_mistakes(const ArrangementEvidence& evidence, const ArrangementOptions& options,
                                              bool columns_only = false);

}  // namespace fxdyn
