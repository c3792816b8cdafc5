#pragma once

#include <vector>

#include "host_tools/diagnose/options.hpp"
#include "host_tools/diagnose/session_log.hpp"

namespace fxdyn::diagnosis {

/// Logs that are longer than a diagnosis has room for, as windows: parts of equal length, spread evenly over each log.
/// Slow changes show in them as in the whole, and memory and time no longer grow with the length. Each log keeps the
/// same share. Every window is a log of its own, as old as the session is when it begins.
/// @param logs with the decimation that they are to have @returns them as they are, where there is room for all
std::vector<SessionLog> in_windows(std::vector<SessionLog> logs, const SessionOptions& options);

/// Samples [from, to) of a log. What a filter's ends or an effect's memory spoil there has to be in it, and be left
/// out: [first, last) are the samples that count, of the part.
ProcessedLog part_of(const ProcessedLog& log, Eigen::Index from, Eigen::Index to, Eigen::Index first,
                     Eigen::Index last);

}  // namespace fxdyn::diagnosis
