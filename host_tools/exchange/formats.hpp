#pragma once

#include <Eigen/Dense>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "host_tools/exchange/simple_robot.hpp"
#include "host_tools/signals/motion.hpp"

namespace fxdyn {

/// Torques of a written file over a motion.
struct ReplayedTorque {
  Eigen::MatrixXd tau;  ///< samples x joints [N*m | N]
  /// 1 where the joint's dry friction is at its limit, against the motion; else it sticks, and how is the simulator's
  /// own affair.
  Eigen::MatrixXd sliding;
};

/// A format of simulators. A new one is a file with two functions and an entry in formats.cpp.
struct ExportFormat {
  const char* name;           ///< what follows --to
  const char* help;           ///< what it is
  const char* file;           ///< name of the file that is written
  const char* reader;         ///< whose library reads it back
  bool has_armature = false;  ///< it knows a rotor's inertia
  /// @throws InputError, DataError: the format can't hold this robot
  void (*write)(const SimpleRobot& robot, const std::filesystem::path& file);
  /// The file as its own library reads it, over a motion of the robot that is expected in it.
  /// @throws DataError: the library refuses the file, or other joints are in it
  ReplayedTorque (*replay)(const std::filesystem::path& file, const IdentifiedModel& expected, const MotionRows& motion,
                           double step_s);
  bool has_stribeck = false;  ///< it knows more dry friction at low speed
  bool has_load = false;      ///< it knows friction that grows with the load
  bool has_ranges = false;    ///< it says what the logs leave open: SimpleRobot::ranges are asked for
  /// It holds the model as the drive's tables have it: SimpleRobot has names only, and replay() expects the model
  /// itself.
  bool whole_model = false;
  /// What the format calls the friction of a joint that is written so; nullptr: it has one form only.
  std::string (*friction_model)(const SimpleJoint& said) = nullptr;
  bool has_dry_friction = true;  ///< it knows friction that does not grow with the speed
};

std::span<const ExportFormat> export_formats();
/// @throws InputError: unknown; lists the known ones
const ExportFormat& export_format(const std::string& name);
/// "urdf, mjcf, .."
std::string export_format_names();

// urdf_format.cpp
void write_urdf_dynamics(const SimpleRobot& robot, const std::filesystem::path& file);
ReplayedTorque replay_urdf(const std::filesystem::path& file, const IdentifiedModel& expected, const MotionRows& motion,
                           double step_s);
// drake_format.cpp
void write_drake(const SimpleRobot& robot, const std::filesystem::path& file);
ReplayedTorque replay_drake(const std::filesystem::path& file, const IdentifiedModel& expected,
                            const MotionRows& motion, double step_s);
// sdf_format.cpp
void write_sdf(const SimpleRobot& robot, const std::filesystem::path& file);
ReplayedTorque replay_sdf(const std::filesystem::path& file, const IdentifiedModel& expected, const MotionRows& motion,
                          double step_s);
/// Whether libsdformat and its reader of ours are here.
bool can_read_sdf();
// mjcf_format.cpp
void write_mjcf(const SimpleRobot& robot, const std::filesystem::path& file);
ReplayedTorque replay_mjcf(const std::filesystem::path& file, const IdentifiedModel& expected, const MotionRows& motion,
                           double step_s);
// isaaclab_format.cpp
void write_isaaclab(const SimpleRobot& robot, const std::filesystem::path& file);
ReplayedTorque replay_isaaclab(const std::filesystem::path& file, const IdentifiedModel& expected,
                               const MotionRows& motion, double step_s);
// bam_format.cpp
void write_bam(const SimpleRobot& robot, const std::filesystem::path& file);
std::string bam_model(const SimpleJoint& said);
ReplayedTorque replay_bam(const std::filesystem::path& file, const IdentifiedModel& expected, const MotionRows& motion,
                          double step_s);
// usd_format.cpp
void write_usd(const SimpleRobot& robot, const std::filesystem::path& file);
ReplayedTorque replay_usd(const std::filesystem::path& file, const IdentifiedModel& expected, const MotionRows& motion,
                          double step_s);

// solver_package.cpp
/// A package of ROS 2 in `folder`, with the tables.hpp that stands beside it.
/// @throws InputError: a joint's name that C++ can't hold in quotes
void write_solver_package(const SimpleRobot& robot, const std::filesystem::path& folder);
/// Torques of the drive's tables of `expected`, each state held until what effects remember has settled.
ReplayedTorque replay_tables(const std::filesystem::path& folder, const IdentifiedModel& expected,
                             const MotionRows& motion, double step_s);
/// The same in double precision: what replay_tables() is meant to give.
Eigen::MatrixXd settled(const IdentifiedModel& model, const MotionRows& motion);
/// Effects of a joint that remember, which the package takes as settled.
std::vector<std::string> settled_effects(const IdentifiedModel& model, std::size_t joint);

}  // namespace fxdyn
