#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn {

/// What the joints of simulators know of friction, at the output of the gear:
/// tau = armature ddq + damping dq + friction sign(dq).
struct SimpleJoint {
  double damping = 0;   ///< [N*m*s/rad | N*s/m]
  double friction = 0;  ///< [N*m | N]
  double armature = 0;  ///< rotor inertia, seen from the joint [kg*m^2 | kg]
  double effort = 0;    ///< the drive's limit, 0: not known [N*m | N]
};

/// A robot in a simulator's terms.
struct SimpleRobot {
  Robot robot;  ///< every joint has its inertial, in the link's URDF frame
  std::vector<SimpleJoint> joints;
  std::filesystem::path urdf;  ///< the project's, which an export may take its other content from
};

struct ProjectionOptions {
  /// Dry friction is fitted where it slides: from this many of the joint's sign widths on, tanh(3) = 0.995 [-]; hand.
  double sliding_widths = 3;
};

/// The model in a simulator's terms. Bodies: those of `bodies`, with the model's payload on the last one. Armature: the
/// model's rotor inertia, where the format has it. Damping d >= 0 and friction f >= 0 minimise, over the samples of the
/// train logs in which the joint slides,
///   sum (tau_model - tau_bodies - armature ddq - d dq - f sign(dq))^2,
/// so they also take what they can of effects that the format does not know.
/// @param bodies the model's links as possible bodies (identified.urdf)
/// @throws DataError: no train log, or a link that is left without mass
SimpleRobot simple_robot(const IdentifiedModel& model, const Robot& bodies, bool has_armature,
                         const std::vector<ProcessedLog>& train, const ProjectionOptions& options = {});

/// The simple robot as a model of ours with sign(dq) for the direction of friction, so that one formula of each torque
/// is enough. Filter, log formats and session are the given model's.
IdentifiedModel as_model(const SimpleRobot& simple, IdentifiedModel model);

/// Effects of a joint, and of the whole body, that a simple robot has no word for. ("bls": the learned part.)
std::vector<std::string> left_out(const IdentifiedModel& model, std::size_t joint, bool has_armature);

}  // namespace fxdyn
