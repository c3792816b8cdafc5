#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "host_tools/logs/log.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn {

/// The first lines of a CSV: minutes, since a recording may begin at rest.
struct CsvHead {
  std::vector<std::string> names;         ///< of the columns; empty: the file has none
  std::vector<std::vector<double>> rows;  ///< numbers of the first lines, NaN where a field is none
  std::size_t columns = 0;
};
/// @throws InputError: not readable, or no line of numbers in it
CsvHead read_head(const std::filesystem::path& file, std::size_t rows = 100'000);

/// What the columns of a CSV hold, by their names, or by their number and numbers where they have none.
struct ColumnGuess {
  LogFormat format;                  ///< joint_columns of q and tau, of dq and ddq where they are there; columns["t"];
                                     ///< time_unit_s where the stamps' steps show another one than seconds
  bool torque_is_current = false;    ///< the torque's columns are called currents
  std::vector<std::string> notes;    ///< what a reader should check
  std::vector<std::string> missing;  ///< what was not found: "t", "q of joint_3"
};
ColumnGuess guess_columns(const CsvHead& head, const Robot& robot);

}  // namespace fxdyn
