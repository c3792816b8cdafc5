#pragma once

#include <optional>
#include <vector>

namespace fxdyn::history {

/// A value of one session.
struct Measured {
  double at = 0;  ///< day, or number of the session
  double value = 0;
  double std = 0;  ///< of the fit, 0: not known
};

/// value = level + slope (at - centre), by least squares.
struct Line {
  double centre = 0, level = 0, slope = 0;
  double level_std = 0, slope_std = 0;  ///< from the scatter of the sessions
  int degrees = 0;                      ///< of freedom: sessions - 2
  double at(double x) const { return level + slope * (x - centre); }
};

/// A jump between two sessions: `before` up to the session `index - 1`, `after` from `index` on.
struct Step {
  std::size_t index = 0;
  double before = 0, after = 0;
  double std = 0;  ///< of the difference
};

enum class Change { none, trend, step };

/// What a series of sessions does.
struct Course {
  Change change =
      Change::none;    ///< the likelier of the two; whether it is significant is for all series together to say
  double log10_p = 0;  ///< of "nothing changes", for the likelier of the two and for both having been tried
  Line line;
  Step step;
  double scatter = 0;  ///< of the sessions about the better of the two [unit of the value]
};

struct CourseOptions {
  /// Sessions below which nothing is said. The scatter from session to session has to be known from the same values,
  /// and with fewer a line or a step fits any of them. Theory: a step has three parameters, and three values have to
  /// judge.
  std::size_t fewest = 6;
};

/// Trend: t test of the slope. Step: the largest of the t tests between all neighbours, with two sessions at least on
/// each side, times their number (Bonferroni). The scatter is never taken for less than what the fits themselves state.
/// None: fewer sessions than options.fewest.
std::optional<Course> course_of(const std::vector<Measured>& series, const CourseOptions& options = {});

/// When a line reaches a limit: the moment, and the 95 % interval about it (Fieller 1954), in units of `at`. The
/// interval is open where the slope may be zero.
struct Reached {
  double at = 0;
  std::optional<double> earliest, latest;
};
/// None: the line does not go there, or is beyond it since before the last session.
std::optional<Reached> when_reached(const Line& line, double limit, double last);

}  // namespace fxdyn::history
