#pragma once

#include <array>
#include <filesystem>
#include <limits>
#include <span>
#include <string_view>

#include "host_tools/signals/log.hpp"

namespace fxdyn {

inline constexpr std::size_t signal_count = 5;
inline constexpr std::array<const char*, signal_count> signal_names{"q", "dq", "ddq", "tau", "qlink"};
/// In the order of the names.
inline std::array<Eigen::MatrixXd*, signal_count> signals_of(Log& log) {
  return {&log.q, &log.dq, &log.ddq, &log.tau, &log.qlink};
}
inline std::array<const Eigen::MatrixXd*, signal_count> signals_of(const Log& log) {
  return {&log.q, &log.dq, &log.ddq, &log.tau, &log.qlink};
}

/// What a reader is asked for.
struct LogRequest {
  std::filesystem::path file;
  std::size_t joints = 0;
  const LogFormat& columns;  ///< names of the signals in the file
  /// The window [from, to) [s].
  double from = -std::numeric_limits<double>::infinity(), to = std::numeric_limits<double>::infinity();
  bool torque_required = true;
};

/// A file as it stands: stamps that rise, without gains, windows checked, unwrapping, units or resampling.
struct RecordedLog {
  Log log;                         ///< t and the signals in the window
  double first_t = 0, last_t = 0;  ///< of the whole file [s]
  /// The unit of the stamps is known: it was written down, by the project or in the column's name.
  bool time_is_known = false;
};

/// A file format. One more: a file with its `read`, and a line in log_reader.cpp.
struct LogReader {
  std::string_view name;
  std::string_view extension;  ///< of the files that it reads, in small letters: ".csv"
  /// @throws InputError naming file, line and column, see read_log()
  RecordedLog (*read)(const LogRequest& request);
};

/// All formats.
std::span<const LogReader> log_readers();
/// By the file's extension, capitals or not; the last reader for all that no other knows.
const LogReader& reader_of(const std::filesystem::path& file, std::span<const LogReader> readers = log_readers());

/// Comma separated values under a line of names.
RecordedLog read_csv(const LogRequest& request);

}  // namespace fxdyn
