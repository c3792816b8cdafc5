#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>

namespace fxdyn {

/// Plays the torque of a log through a model (simulate_forward()) and writes to `directory`: forward.json with the RMSE
/// of each joint's position in open and in closed loop [rad | m], open.csv and closed.csv with the positions as logs,
/// forward.svg. Returns a table for the terminal.
/// @param given the first samples of the log that are known to the simulation
/// @throws InputError, DataError as simulate_forward() and read_log(); nothing is written then
std::string forward_log(const std::filesystem::path& model, const std::filesystem::path& log, Eigen::Index given,
                        const std::filesystem::path& directory);

}  // namespace fxdyn
