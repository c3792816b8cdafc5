#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace fxdyn {

/// A picture that write_comparison_plots() draws.
struct ComparisonPlot {
  const char* file;   ///< in DIR/plots
  const char* title;  ///< for the report
};
inline constexpr ComparisonPlot comparison_plots[] = {
    {"compare_trajectories.svg", "Excitation: the first train log (as Fig. 5)"},
    {"compare_friction.svg", "Friction torque: true, measured, learned (as Fig. 6)"},
    {"compare_friction_error.svg", "Error of the learned friction torque (as Fig. 7)"},
    {"compare_torque.svg", "Total torque: true and predicted (as Fig. 8)"},
    {"compare_torque_error.svg", "Error of the total torque (as Fig. 9)"},
    {"compare_methods.svg", "RLS, MLP, BLS against the truth (as Fig. 10)"},
    {"compare_methods_error.svg", "Smoothed error of the methods (as Fig. 11)"},
};

/// Sections of report.html from compare.json, with the pictures in DIR/plots, and from vibration.json and
/// efficiency.json; null: left out.
std::string comparison_section(const nlohmann::json& comparison, const std::filesystem::path& directory);
std::string vibration_section(const nlohmann::json& vibration);
std::string efficiency_section(const nlohmann::json& efficiency);

}  // namespace fxdyn
