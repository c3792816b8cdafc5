#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace fxdyn {

/// Unit of time stamps.
struct TimeUnit {
  const char* name;
  double per_second;
};
inline constexpr std::array time_units{TimeUnit{"s", 1}, TimeUnit{"ms", 1e3}, TimeUnit{"us", 1e6}, TimeUnit{"ns", 1e9}};

/// By its name. @throws InputError: there is none
TimeUnit time_unit(std::string_view name);

/// Of so many seconds, as LogFormat has it.
TimeUnit unit_of_seconds(double seconds);

/// What a column's name says: "t_ms", "time (ns)", "stamp [us]".
std::optional<TimeUnit> unit_in_name(std::string_view column);

/// From the first stamps of a log: seconds, unless their steps make that impossible.
/// @throws InputError: neither the steps nor the size of the stamps tell two units apart; names the line to write
TimeUnit unit_of_stamps(const std::vector<double>& stamps, const std::string& file);
/// What to tell of a unit that the steps have shown.
std::string unit_note(const TimeUnit& unit, const std::string& file);

}  // namespace fxdyn
