#pragma once

#include <Eigen/Dense>
#include <filesystem>
#include <string>

namespace fxdyn {

/// `fxdyn refine`: a model of the project with parameters that fit the simulated positions of its train logs, in
/// `directory`: refined.json and refine.json. @return what to tell people
std::string refine_model(const std::filesystem::path& project, const std::filesystem::path& model, Eigen::Index given,
                         const std::filesystem::path& directory);

}  // namespace fxdyn
