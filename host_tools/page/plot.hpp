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

/// Each plot as an <svg> element, drawn by one run of gnuplot. Curves have at most 1000 points, fewer where many plots
/// would make the page heavy; the extremes of what is left out are kept.
/// Where gnuplot is missing or fails, a picture that says so, and a note on stderr.
std::vector<std::string> draw(const std::vector<TorquePlot>& plots);

/// Curves over time, one colour each, as a panel of a picture.
struct Panel {
  std::string label;        ///< with unit, as in "q [rad]"
  Eigen::VectorXd t;        ///< [s]
  Eigen::MatrixXd columns;  ///< samples x curves
};

/// Panels one above the other over the same time, as an <svg> element; `names` of the curves are the key.
/// Where gnuplot is missing or fails, a picture that says so, and a note on stderr.
std::string draw(const std::vector<Panel>& panels, const std::vector<std::string>& names);

/// One curve of a chart. Of curves over a growing abscissa the extremes of what is left out are kept; a `path` may go
/// back and forth; every n-th point of it is drawn, and NaN in y breaks the line.
struct Trace {
  Eigen::VectorXd x, y;
  std::string colour;  ///< #RRGGBB, or #AARRGGBB with AA = 00 for solid .. ff for nothing
  double width = 1.2;
  std::string title = {};  ///< empty: not in the key
  bool path = false;
  Eigen::VectorXd y_top = {};  ///< a band from y to here instead of a line
};

struct Chart {
  std::string x_label, y_label;  ///< with unit
  std::vector<Trace> curves;
  bool logarithmic = false;     ///< y
  double y_from = 0, y_to = 0;  ///< the axis; equal: as the curves need
};

/// Charts side by side, `columns` in a row, as an <svg> element.
/// Where gnuplot is missing or fails, a picture that says so, and a note on stderr.
std::string draw(const std::vector<Chart>& charts, int columns);
/// Many such pictures by one run of gnuplot.
std::vector<std::string> draw(const std::vector<std::vector<Chart>>& pictures, int columns);

}  // namespace fxdyn
