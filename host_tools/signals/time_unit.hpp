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

/// "stamp [ns]": what LogFormat::columns has for `t` where the project says `time_unit`.
std::string with_unit(std::string_view column, std::string_view unit);
/// The column, and the unit in brackets behind it if there is one.
std::pair<std::string, std::optional<TimeUnit>> without_unit(std::string_view column);
/// Another column with the unit of `column`, if that has one.
std::string with_name(std::string_view column, const std::string& name);

/// What a column's name says: "t_ms", "time (ns)", "stamp [us]".
std::optional<TimeUnit> unit_in_name(std::string_view column);

/// From the first stamps of a log: seconds, unless their steps make that impossible.
/// @throws InputError: neither the steps nor the size of the stamps tell two units apart; names the line to write
TimeUnit unit_of_stamps(const std::vector<double>& stamps, const std::string& file);

}  // namespace fxdyn
