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

/// Curves over time, one colour each, as a panel of a picture.
struct Panel {
  std::string label;        ///< with unit, as in "q [rad]"
  Eigen::VectorXd t;        ///< [s]
  Eigen::MatrixXd columns;  ///< samples x curves
};

/// Panels one above the other over the same time, as an <svg> element; `names` of the curves are the key.
/// @throws InputError where gnuplot is missing or fails.
std::string draw(const std::vector<Panel>& panels, const std::vector<std::string>& names);

}  // namespace fxdyn
