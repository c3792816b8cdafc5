#pragma once

#include <Eigen/Dense>
#include <filesystem>
#include <optional>

namespace fxdyn {

/// Noise-free torques that `fxdyn simulate` writes beside a log (<log>.truth.csv), samples x joints; of the window
/// [from_s, to_s) where one is given. Errors as read_log().
Eigen::MatrixXd read_truth(const std::filesystem::path& file, std::size_t joints,
                           std::optional<double> from_s = std::nullopt, std::optional<double> to_s = std::nullopt);

}  // namespace fxdyn
