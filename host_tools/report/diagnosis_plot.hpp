#pragma once

#include <filesystem>

namespace fxdyn {

/// Where the plot of a joint (from 0) is.
std::filesystem::path diagnosis_plot(const std::filesystem::path& directory, std::size_t joint);

}  // namespace fxdyn
