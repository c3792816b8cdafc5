#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "model/rigid_body.hpp"

namespace fxdyn {

struct Limits {
  double lower = 0, upper = 0;  ///< position [rad | m]
  double velocity = 0;          ///< [rad/s | m/s]
  double effort = 0;            ///< [N*m | N]
};

/// Inertia of a link in its URDF frame (fixed joints merged): mass [kg], centre of mass [m], tensor about the centre
/// [kg m^2].
struct Inertial {
  double mass = 0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Matrix3d tensor = Eigen::Matrix3d::Zero();
};

/// A moving joint and the link that it carries.
struct Joint {
  std::string name;
  std::string link;  ///< the child link
  JointType type = JointType::revolute;
  bool continuous = false;  ///< no position limits
  Eigen::Isometry3d origin =
      Eigen::Isometry3d::Identity();                ///< child frame in the previous moving link's frame, at q = 0
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< unit vector in the child frame
  std::optional<Limits> limits;
  std::optional<Inertial> inertial;
  /// Origins of the frames fixed to the child link (flange, tool), in its frame [m].
  std::vector<Eigen::Vector3d> fixed_frames{};

  /// SI unit of position, velocity, torque ...: "rad" or "m".
  const char* position_unit() const { return type == JointType::revolute ? "rad" : "m"; }
  const char* torque_unit() const { return type == JointType::revolute ? "N*m" : "N"; }
};

/// A serial chain. Frames as in the URDF.
struct Robot {
  std::string name;
  std::vector<Joint> joints;                 ///< moving joints in chain order
  Eigen::Vector3d gravity{0.0, 0.0, -9.81};  ///< in the base frame [m/s^2]
  std::size_t size() const { return joints.size(); }
};

/// Reads a URDF. Fixed joints are merged (their inertias added to the moving link before them); any axis; revolute,
/// continuous and prismatic joints.
/// @throws InputError with file and, where known, line or joint: not readable, malformed XML, a branch, another joint
/// type, a zero axis, no moving joint, an inertia that is not positive.
Robot read_urdf(const std::filesystem::path& file);

/// Forward kinematics: origins of all links' URDF frames in the base frame [m], 3 x points: joint by joint the child
/// link's, then those fixed to it (so the flange is the last). q: one a joint [rad | m].
Eigen::Matrix3Xd link_origins(const Robot& robot, const Eigen::VectorXd& q);

/// The same chain in the frames of model/rigid_body.hpp (modified DH), see there.
struct DhChain {
  std::vector<LinkGeometry<Real>> links;
  Eigen::Vector3d up = Eigen::Vector3d::Zero();  ///< minus gravity in the first DH frame [m/s^2]
  std::vector<Eigen::Isometry3d> urdf_in_dh;     ///< pose of each link's URDF frame in its DH frame (constant)
};
DhChain to_dh(const Robot& robot);

/// Ten parameters of model/rigid_body.hpp, of a body given in a frame whose pose in the DH frame is `pose`.
LinkInertia<Real> to_link_inertia(const Inertial& inertial, const Eigen::Isometry3d& pose);
/// Back from the DH frame. The mass must not be zero.
Inertial to_inertial(const LinkInertia<Real>& link, const Eigen::Isometry3d& pose);

/// The last link with a point mass at `com` in its URDF frame.
LinkInertia<Real> with_load(const LinkInertia<Real>& last, double mass, const Eigen::Vector3d& com,
                            const DhChain& chain);

}  // namespace fxdyn
