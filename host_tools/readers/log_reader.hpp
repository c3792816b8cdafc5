#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/logs/recorded_log.hpp"

namespace fxdyn {

/// The columns of a file that may hold several logs: of each topic of a recording, of each struct or group of arrays.
struct LogColumns {
  std::string topic;
  std::vector<std::string> names;
};

/// The entry of LogFormat::columns that says which topic, struct or group is meant; none: the one that has the joints.
inline constexpr const char* topic_key = "topic";

/// A file format. One more: a file with its `read`, and a line in log_reader.cpp.
struct LogReader {
  std::string_view name;
  std::string_view extension;  ///< of the files that it reads, in small letters: ".csv"
  /// @throws InputError naming file, line and column, see read_log()
  RecordedLog (*read)(const LogRequest& request);
  /// Whether a file is its own, by its first bytes; it may have any name. nullptr: the extension says it.
  bool (*knows)(const std::filesystem::path& file) = nullptr;
  /// Of a format that may hold several logs; the topic that serves best first. nullptr: a line of the text names the
  /// columns.
  /// @throws InputError: it has none
  std::vector<LogColumns> (*columns)(const std::filesystem::path& file) = nullptr;
  bool names_joints = false;  ///< its columns carry the joints' names, as in "elbow.effort"
};

/// All formats.
std::span<const LogReader> log_readers();
/// By the file's first bytes, else by its extension, capitals or not; the last reader for all that no other knows.
const LogReader& reader_of(const std::filesystem::path& file, std::span<const LogReader> readers = log_readers());

/// A bag of ROS 2, see bags/bag.hpp: a topic of sensor_msgs/msg/JointState or
/// control_msgs/msg/JointTrajectoryControllerState. Its columns are "t" [s since the topic's first message],
/// "JOINT.position", ".velocity", ".acceleration", ".effort"; of a controller also "JOINT.reference." and
/// "JOINT.command." with these. Two ends of a recording that carry no numbers are left out, and told.
RecordedLog read_bag_log(const LogRequest& request);
std::vector<LogColumns> bag_columns(const std::filesystem::path& file);
/// Arrays of MATLAB (4, 5, 7.3), HDF5 or Parquet with a vector of stamps, see array_groups.hpp: one row or one column
/// of each a sample. Samples at the end that were never filled (NaN) are left out, and told.
RecordedLog read_array_log(const LogRequest& request);
std::vector<LogColumns> array_columns(const std::filesystem::path& file);

/// Frames of a CAN bus as candump of can-utils writes them: a row at every SYNC. Columns are q1.., tau1.. of fxdyn's
/// drive node (setpoints [raw] and torques [N*m | N]) or of CiA 402 drives (counts, per mille; i32 and i16 of 0x180 +
/// node), and any number of a frame as "181.i32.0": identifier, type (i, u: 8, 16, 32; f32), first byte.
RecordedLog read_can_log(const LogRequest& request);
std::vector<LogColumns> can_columns(const std::filesystem::path& file);
bool is_can_log(const std::filesystem::path& file);

/// The format for a file that names its joints: the columns of the robot's joints, for all signals that the format does
/// not say. Of other files, the format as it is.
/// @param joints their names in the URDF, in the order of the chain
LogFormat with_joint_names(const std::filesystem::path& file, LogFormat format, const std::vector<std::string>& joints);
/// Such columns: "elbow.position" of q.
std::vector<std::string> joint_columns_of(const std::string& signal, const std::vector<std::string>& joints);

/// Reads `joints` joints. Irregular stamps (jitter > 1 % of the median step) are resampled to the median step by
/// monotone-safe linear interpolation and `resampled` is set; a gap > 10 steps is an error. Revolute joints
/// are unwrapped where q jumps by about 2 pi between samples.
/// @throws InputError naming file, line and column: missing column (names the nearest existing one), NaN or a
/// non-number, time going backwards or standing still, a row with another number of fields, fewer than 2 rows; revolute
/// q that looks like degrees (says "looks like degrees, multiply by pi/180"), window outside the file.
/// `torque_required`: predict reads logs without torque.
Log read_log(const std::filesystem::path& file, std::size_t joints, const std::vector<bool>& revolute,
             const LogFormat& format, std::optional<double> from_s, std::optional<double> to_s,
             bool torque_required = true);

}  // namespace fxdyn
