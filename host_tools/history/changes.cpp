#include "host_tools/history/changes.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/history/student.hpp"

namespace fxdyn::history {
namespace {

double mean_of(const std::vector<Measured>& series, std::size_t from, std::size_t to, double Measured::*what) {
  double sum = 0;
  for (std::size_t i = from; i < to; ++i) sum += series[i].*what;
  return sum / static_cast<double>(to - from);
}

/// Mean square of what the fits state.
double stated(const std::vector<Measured>& series) {
  double sum = 0;
  for (const Measured& m : series) sum += m.std * m.std;
  return sum / static_cast<double>(series.size());
}

/// The line, and the variance of the sessions about it.
std::pair<Line, double> line_of(const std::vector<Measured>& series) {
  const std::size_t n = series.size();
  Line line;
  line.centre = mean_of(series, 0, n, &Measured::at);
  line.level = mean_of(series, 0, n, &Measured::value);
  line.degrees = static_cast<int>(n) - 2;
  double xx = 0, xy = 0, left = 0;
  for (const Measured& m : series) {
    xx += (m.at - line.centre) * (m.at - line.centre);
    xy += (m.at - line.centre) * (m.value - line.level);
  }
  line.slope = xx > 0 ? xy / xx : 0;
  for (const Measured& m : series) left += std::pow(m.value - line.at(m.at), 2);
  const double variance = std::max(left / line.degrees, stated(series));
  line.level_std = std::sqrt(variance / static_cast<double>(n));
  line.slope_std = xx > 0 ? std::sqrt(variance / xx) : 0;
  return {line, variance};
}

/// The step with the largest t among all places, and the variance about it.
std::pair<Step, double> step_of(const std::vector<Measured>& series) {
  const std::size_t n = series.size();
  Step best;
  double largest = -1, variance_there = 0;
  for (std::size_t k = 2; k + 2 <= n; ++k) {
    const double before = mean_of(series, 0, k, &Measured::value), after = mean_of(series, k, n, &Measured::value);
    double left = 0;
    for (std::size_t i = 0; i < n; ++i) left += std::pow(series[i].value - (i < k ? before : after), 2);
    const double variance = std::max(left / static_cast<double>(n - 2), stated(series));
    const double std = std::sqrt(variance * (1.0 / static_cast<double>(k) + 1.0 / static_cast<double>(n - k)));
    const double t = std > 0 ? std::fabs(after - before) / std : 0;
    if (t <= largest) continue;
    largest = t;
    variance_there = variance;
    best = {k, before, after, std};
  }
  return {best, variance_there};
}

double log10_p(double difference, double std, int degrees, double tries) {
  if (!(std > 0)) return 0;
  return std::min(0.0, std::log10(tries * two_sided_p(difference / std, degrees)));
}

}  // namespace

std::optional<Course> course_of(const std::vector<Measured>& series, const CourseOptions& options) {
  if (series.size() < options.fewest) return {};
  const auto [line, about_line] = line_of(series);
  const auto [step, about_step] = step_of(series);
  const double places = static_cast<double>(series.size() - 3);
  constexpr double both = 2;  // a trend and a step are tried
  const double trend_p = log10_p(line.slope, line.slope_std, line.degrees, both);
  const double step_p = log10_p(step.after - step.before, step.std, line.degrees, both * places);
  Course course{.change = Change::none, .log10_p = std::min(trend_p, step_p), .line = line, .step = step};
  const bool is_step = step_p < trend_p;
  course.scatter = std::sqrt(is_step ? about_step : about_line);
  if (course.log10_p < 0) course.change = is_step ? Change::step : Change::trend;
  return course;
}

std::optional<Reached> when_reached(const Line& line, double limit, double last) {
  if (line.slope == 0) return {};
  const double distance = limit - line.level;  // from the centre, where level and slope are independent
  const double at = line.centre + distance / line.slope;
  if (at <= last) return {};
  Reached out{at, {}, {}};
  // (level + slope x - limit)^2 = q^2 (level_std^2 + x^2 slope_std^2)
  const double q = two_sided_quantile(0.05, line.degrees);
  const double a = line.slope * line.slope - q * q * line.slope_std * line.slope_std;
  const double b = -2 * line.slope * distance, c = distance * distance - q * q * line.level_std * line.level_std;
  const double inside = b * b - 4 * a * c;
  if (inside < 0) return out;
  double first = (-b - std::sqrt(inside)) / (2 * a), second = (-b + std::sqrt(inside)) / (2 * a);
  if (first > second) std::swap(first, second);
  if (a > 0) {
    out.earliest = std::max(last, line.centre + first);
    out.latest = line.centre + second;
  } else {
    // the slope may be zero: never is possible
    const double root = distance / line.slope > 0 ? std::max(first, second) : std::min(first, second);
    if (line.centre + root > last) out.earliest = line.centre + root;
  }
  return out;
}

}  // namespace fxdyn::history
