#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace fxdyn {

/// Runs a scenario file: writes one log per [[log]] of it, named <log name>.csv, with <log name>.truth.csv and
/// truth.json beside them, into `directory`. The same scenario gives the same bytes.
/// @return the paths of the logs, in the scenario's order.
/// @throws InputError with file and line.
std::vector<std::filesystem::path> simulate(const std::filesystem::path& scenario,
                                            const std::filesystem::path& directory);

/// Of the scenario file and its URDF: the logs made from them are still theirs while it is the same.
std::string scenario_hash(const std::filesystem::path& scenario);

}  // namespace fxdyn
