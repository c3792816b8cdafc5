#pragma once

#include <Eigen/Dense>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "host_tools/effects/model_value.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn {

/// Dry friction that grows with the torques on the gear, as BAM has it in m3 to m6 (bam/model.py). With the motor's
/// torque m, the external torque e (gravity and Coriolis, minus what the bodies ask of the joint without acceleration)
/// and bell = exp(-(dq / stribeck_velocity)^2) the joint has this more of it:
///   |external e - motor m| + bell |external_stribeck e - motor_stribeck m|, and, where e and m have opposite signs,
///   + bell external_quad e^2 where |e| < |m|, + bell motor_quad m^2 where |e| > |m|.
/// In m3 and m4 the coefficients of m and e are the same.
struct GearFriction {
  int model = 0;                                     ///< 3 .. 6; 0: none
  double motor = 0, external = 0;                    ///< [-]
  double motor_stribeck = 0, external_stribeck = 0;  ///< [-]
  double motor_quad = 0, external_quad = 0;          ///< [1/(N*m) | 1/N]
};

/// What the joints of simulators know of friction, at the output of the gear:
/// tau = armature ddq + damping dq + (friction + stribeck exp(-(dq / stribeck_velocity)^2)) sign(dq).
struct SimpleJoint {
  double damping = 0;            ///< [N*m*s/rad | N*s/m]
  double friction = 0;           ///< [N*m | N]
  double armature = 0;           ///< rotor inertia, seen from the joint [kg*m^2 | kg]
  double effort = 0;             ///< the drive's limit, 0: not known [N*m | N]
  double stribeck = 0;           ///< more dry friction at low speed; 0 in formats that don't know it [N*m | N]
  double stribeck_velocity = 0;  ///< 0 without [rad/s | m/s]
  GearFriction load{};           ///< of formats that know it
};

/// What the logs leave open of a joint's damping, friction and armature, in this order and in the units of SimpleJoint.
struct JointRange {
  /// Of the model's friction alone: without what damping and friction take of other effects (offset, spring, ..).
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  /// A number whose variance is 0 is at its bound of 0, or not fitted.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  /// Degrees of freedom of the estimate of the covariance.
  double freedom = 0;
};

/// A robot in a simulator's terms.
struct SimpleRobot {
  Robot robot;  ///< every joint has its inertial, in the link's URDF frame
  std::vector<SimpleJoint> joints;
  std::filesystem::path urdf;        ///< the project's, which an export may take its other content from
  std::vector<JointRange> ranges{};  ///< per joint (posterior.hpp); empty: not asked for
  /// Per joint what would be said if the format had the model's own load friction (load_friction.hpp): tells what
  /// another formula of it costs. Empty: no joint has any.
  std::vector<SimpleJoint> beside_load{};
};

struct ProjectionOptions {
  /// Dry friction is fitted where it slides: from this many of the joint's sign widths on, tanh(3) = 0.995 [-]; hand.
  double sliding_widths = 3;
  bool dry_friction = true;  ///< the format has it; else damping takes what it can of it
};

/// Damping and dry friction of one joint [as in SimpleJoint].
struct FrictionPair {
  double damping = 0, friction = 0;
};

/// Per joint the d and f that minimise, over the samples of the logs in which the joint slides,
///   sum (rest - d dq - f sign(dq))^2.
/// @param rest torque of all joints over a log, samples x joints, at the motion's own times
/// @param inside per joint: the minimum without bounds over those of d and f that are not 0 here (the rest stays 0), so
/// that the result is linear in `rest`; empty: d, f >= 0
std::vector<FrictionPair> fit_friction(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs,
                                       const std::function<Eigen::MatrixXd(const ProcessedLog&)>& rest,
                                       const std::vector<SimpleJoint>& inside = {},
                                       const ProjectionOptions& options = {});

/// The model in a simulator's terms. Bodies: those of `bodies`, with the model's payload on the last one. Armature: the
/// model's rotor inertia, where the format has it. Damping d >= 0 and friction f >= 0 minimise, over the samples of the
/// train logs in which the joint slides,
///   sum (tau_model - tau_bodies - armature ddq - d dq - f sign(dq))^2,
/// so they also take what they can of effects that the format does not know. Stribeck friction, where the format has
/// it and the model too, is the model's own, and taken off first.
/// @param bodies the model's links as possible bodies (identified.urdf)
/// @throws DataError: no train log, or a link that is left without mass
SimpleRobot simple_robot(const IdentifiedModel& model, const Robot& bodies, bool has_armature,
                         const std::vector<ProcessedLog>& train, const ProjectionOptions& options = {},
                         bool has_stribeck = false);

/// The simple robot as a model of ours with sign(dq) for the direction of friction, so that one formula of each torque
/// is enough. Filter, log formats and session are the given model's.
ModelValue as_model(const SimpleRobot& simple, ModelValue model);

/// Effects of a joint, and of the whole body, that a simple robot has no word for. ("bls": the learned part.)
std::vector<std::string> left_out(const IdentifiedModel& model, std::size_t joint, bool has_armature,
                                  bool has_stribeck = false, bool has_load = false, bool has_dry_friction = true);

}  // namespace fxdyn
