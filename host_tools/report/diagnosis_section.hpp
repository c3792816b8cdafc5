#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace fxdyn {

/// The section "Diagnosis" of report.html from diagnosis.json and the plots beside it, DIR/plots.
std::string diagnosis_section(const nlohmann::json& diagnosis, const std::filesystem::path& directory);

/// Where the plot of a joint (from 0) is.
std::filesystem::path diagnosis_plot(const std::filesystem::path& directory, std::size_t joint);

}  // namespace fxdyn
