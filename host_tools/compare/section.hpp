#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace fxdyn {

/// Sections of report.html from compare.json, with the pictures in DIR/plots, and from vibration.json and
/// efficiency.json; null: left out.
std::string comparison_section(const nlohmann::json& comparison, const std::filesystem::path& directory);
std::string vibration_section(const nlohmann::json& vibration);
std::string efficiency_section(const nlohmann::json& efficiency);

}  // namespace fxdyn
