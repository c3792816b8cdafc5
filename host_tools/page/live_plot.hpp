#pragma once

#include <Eigen/Dense>
#include <string>
#include <string_view>

namespace fxdyn::page {

/// One joint over time, as report.html shows it where scripts run: torque, residual, velocity and position under one
/// cursor and one zoom.
struct LivePlot {
  Eigen::VectorXd t;                    ///< [s], rising
  Eigen::VectorXd measured, predicted;  ///< [N*m | N]
  Eigen::VectorXd velocity, position;   ///< [rad/s | m/s], [rad | m]
  std::string torque_unit, path_unit;   ///< "N*m" and "rad", or "N" and "m"
  Eigen::Index most_samples = 2000;     ///< that go into the page; the residual's extremes are kept
};

/// Whether this build has the plotting library (plotting/embed.cmake); else figures are pictures and no more.
bool has_live_plots();

/// figure(), and the plot's data for live_parts(): numbers of 16 bits between the least and the largest of their
/// column.
std::string live_figure(std::string_view svg, std::string_view caption, const LivePlot& plot);

/// What a page with a live_figure() needs once, at its end: style sheet, the library with its licence, and the script
/// that puts a live plot in the place of each such picture. It asks for nothing and works from a file.
std::string live_parts();

/// Of plotting/embed.cmake; empty where npm was missing.
extern const char* const live_style;
extern const char* const live_script;

}  // namespace fxdyn::page
