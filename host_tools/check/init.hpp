#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace fxdyn {

/// A commented project file for these logs of the URDF's robot: columns as their names or numbers say, gains to fill in
/// where the torque is a current, windows without standstill, and roles: one log is cut in two, of several the last one
/// judges. Paths are relative to `directory`.
/// @param columns the value of the key `columns`; what it does not name is guessed; empty: all of it
/// @throws InputError: a file that can't be read, columns that can't be told
std::string init_project(const std::vector<std::filesystem::path>& logs, const std::filesystem::path& urdf,
                         const std::filesystem::path& directory, const std::string& columns = {});

}  // namespace fxdyn
