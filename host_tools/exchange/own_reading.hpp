#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "host_tools/exchange/formats.hpp"

// Of formats whose own library is not here: the joints are in the file, the bodies in a URDF beside it, and fxdyn reads
// both back itself.

namespace fxdyn {

/// What ExportFormat::reader says of them.
inline constexpr const char* own_reader = "fxdyn itself";

/// The URDF beside the file: its name, with another ending.
std::filesystem::path bodies_of(const std::filesystem::path& file);
/// Writes it: the identified bodies, joints without friction (that is in the file).
void write_bodies(const SimpleRobot& robot, const std::filesystem::path& file);

/// Torques of the joints that the file says, with the bodies beside it.
/// @throws DataError: other joints are in the URDF
ReplayedTorque replay_joints(const std::filesystem::path& file, std::vector<SimpleJoint> said,
                             const IdentifiedModel& expected, const MotionRows& motion, double step_s);

/// The number of a joint in a table by names. @throws DataError: it is not there, or no number
double number_of(const nlohmann::json& table, const std::string& key, const std::filesystem::path& file);

}  // namespace fxdyn
