#include "host_tools/logs/time_unit.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "host_tools/logs/quantile.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

/// Sampling intervals of robots' logs [s]: 50 kHz to 5 Hz.
constexpr double shortest_step_s = 2e-5, longest_step_s = 0.2;
/// Fewer stamps say nothing about the interval.
constexpr std::size_t fewest_stamps = 20;
/// Stamps since 1970 [s]: 2001 to 2100.
constexpr double earliest_epoch_s = 1e9, latest_epoch_s = 4.1e9;

bool is_interval(double step_s) { return step_s >= shortest_step_s && step_s <= longest_step_s; }

/// Since 1970, in whichever unit that makes a date and an interval.
std::optional<TimeUnit> unit_of_epoch(double stamp, double step) {
  for (const TimeUnit& unit : time_units) {
    const double seconds = stamp / unit.per_second;
    if (seconds > earliest_epoch_s && seconds < latest_epoch_s && is_interval(step / unit.per_second)) return unit;
  }
  return {};
}

}  // namespace

TimeUnit time_unit(std::string_view name) {
  for (const TimeUnit& unit : time_units) {
    if (name == unit.name) return unit;
  }
  throw InputError(fmt::format("'{}' is no unit of time stamps; use s, ms, us or ns", name));
}

TimeUnit unit_of_seconds(double seconds) {
  for (const TimeUnit& unit : time_units) {
    if (std::fabs(seconds * unit.per_second - 1) < 1e-6) return unit;
  }
  return {"", 1 / seconds};
}

std::optional<TimeUnit> unit_in_name(std::string_view column) {
  while (!column.empty() && (column.back() == ')' || column.back() == ']' || column.back() == ' '))
    column.remove_suffix(1);
  for (const TimeUnit& unit : time_units) {
    if (!column.ends_with(unit.name)) continue;
    const std::string_view rest = column.substr(0, column.size() - std::string_view(unit.name).size());
    if (!rest.empty() && std::string_view("_ ([").find(rest.back()) != std::string_view::npos) return unit;
  }
  return {};
}

TimeUnit unit_of_stamps(const std::vector<double>& stamps, const std::string& file) {
  if (stamps.size() < fewest_stamps) return time_units[0];
  Eigen::VectorXd steps(static_cast<Eigen::Index>(stamps.size()) - 1);
  for (std::size_t i = 1; i < stamps.size(); ++i) steps[static_cast<Eigen::Index>(i) - 1] = stamps[i] - stamps[i - 1];
  const double step = quantile(steps, 0.5);
  if (const auto unit = unit_of_epoch(stamps.front(), step)) return *unit;
  if (!(step > longest_step_s)) return time_units[0];  // rows that are no ascending stamps are refused later
  std::vector<TimeUnit> possible;
  std::vector<std::string> words;
  for (const TimeUnit& unit : time_units) {
    if (!is_interval(step / unit.per_second)) continue;
    possible.push_back(unit);
    words.push_back(fmt::format("{} at {:.3g} samples a second", unit.name, unit.per_second / step));
  }
  if (possible.size() == 1) return possible.front();
  throw InputError(fmt::format(
      "{}: time stamps {:.6g} apart {}; write time_unit = \"{}\" (or another of s, ms, us, "
      "ns) into its [[log]], or into [signals]",
      file, step,
      possible.empty() ? "are in no unit of a robot's log" : fmt::format("may be {}", fmt::join(words, " or ")),
      possible.empty() ? "s" : possible.front().name));
}

std::string unit_note(const TimeUnit& unit, const std::string& file) {
  return fmt::format(
      "{}: time stamps read as {}, by their steps; time_unit = \"{}\" in its [[log]] says it, or another of s, ms, "
      "us, ns",
      file, unit.name, unit.name);
}

}  // namespace fxdyn
