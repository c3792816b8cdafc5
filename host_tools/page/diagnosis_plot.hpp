#pragma once

#include <fmt/format.h>

#include <filesystem>

namespace fxdyn {

/// Where `diagnose` puts the plot of a joint (from 0), and the report finds it.
inline std::filesystem::path diagnosis_plot(const std::filesystem::path& directory, std::size_t joint) {
  return directory / "plots" / fmt::format("diagnosis_joint_{}.svg", joint + 1);
}

}  // namespace fxdyn
