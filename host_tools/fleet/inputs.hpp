#pragma once

#include <filesystem>
#include <string>

#include "host_tools/fleet/fleet_file.hpp"

namespace fxdyn::fleet {

/// What a robot's program is started on.
struct Inputs {
  std::filesystem::path project;  ///< its own file, or FOLDER/project.toml with overrides and baseline in it
  std::string hash;               ///< SHA-256 of version, verb, project, URDF, scenarios and logs
};

/// Writes FOLDER/project.toml where the fleet file says something of the robot.
/// @throws InputError: the project is gone or wrong
Inputs inputs_of(const Fleet& fleet, const Member& member, const std::filesystem::path& folder);

}  // namespace fxdyn::fleet
