#pragma once

namespace fxdyn {

/// A picture that write_comparison_plots() draws and the section of report.html shows.
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

}  // namespace fxdyn
