#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/history/changes.hpp"

namespace fxdyn::history {

/// A quantity that may drift: an effect's parameter at a joint, or the joint's error.
struct Quantity {
  std::string joint, name, unit;  ///< "elbow", "coulomb amplitude", "N*m"
  std::string label() const { return joint + " " + name; }
  auto operator<=>(const Quantity&) const = default;
};

/// Results of one session of the robot: a folder that identify or diagnose wrote.
struct Session {
  std::string name;           ///< of the folder
  std::optional<double> day;  ///< since 1970-01-01; none: nothing tells
  std::string robot;          ///< name in its URDF
  std::vector<std::string> joints;
  std::map<Quantity, Measured> values;       ///< without `at`
  std::map<std::string, double> good_error;  ///< per joint: the error that is good enough [N*m | N]
  std::vector<std::string> effects;          ///< "elbow: ripple": what the diagnosis has for sure
  std::string judged_on;                     ///< train, validate or test: what the errors are of
};

/// Name of a joint's error on the logs that judge.
inline constexpr const char* error_name = "error";

/// The day: of the logs' time stamps where they count from 1970, else a date in the name of the folder or of a log
/// (2026-05-01 or 20260501).
/// @param good_enough share of rated torque
/// @throws InputError: no results in the folder
Session read_session(const std::filesystem::path& folder, double good_enough);

/// "2026-05-01"
std::string date_of(double day);
/// The first date in a text, as a day.
std::optional<double> day_in(const std::string& text);

}  // namespace fxdyn::history
