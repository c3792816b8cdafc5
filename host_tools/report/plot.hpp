#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

namespace fxdyn {

/// Measured and predicted torque of one joint over time; the residual is drawn beneath.
struct TorquePlot {
  Eigen::VectorXd t, measured, predicted;  ///< [s], [N*m | N]
  std::string unit;                        ///< "N*m" or "N"
};

/// Each plot as an <svg> element, drawn by one run of gnuplot. Curves have at most 2000 points, fewer where many plots
/// would make the page heavy; the extremes of what is left out are kept.
/// @throws InputError where gnuplot is missing or fails.
std::vector<std::string> draw(const std::vector<TorquePlot>& plots);

}  // namespace fxdyn
