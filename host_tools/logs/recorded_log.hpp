#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "host_tools/logs/log.hpp"

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

/// Comma separated values under a line of names.
RecordedLog read_csv(const LogRequest& request);

/// What reads a file of some format.
using ReadRecording = std::function<RecordedLog(const LogRequest& request)>;
/// What `read` makes of a file, in SI units on a uniform time grid: read_log() of readers/log_reader.hpp, which knows
/// every format, has the details.
Log uniform_log(const ReadRecording& read, const std::filesystem::path& file, std::size_t joints,
                const std::vector<bool>& revolute, const LogFormat& format, std::optional<double> from_s,
                std::optional<double> to_s, bool torque_required = true);

}  // namespace fxdyn
