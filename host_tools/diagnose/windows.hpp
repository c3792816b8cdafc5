#pragma once

#include <vector>

#include "host_tools/diagnose/options.hpp"
#include "host_tools/diagnose/session_log.hpp"

namespace fxdyn::diagnosis {

/// Recordings that are longer than a diagnosis has room for, as windows: parts of equal length, spread evenly over each
/// of them. Slow changes show in them as in the whole, and what the search takes no longer grows with the length. The
/// longest recordings give up rows first: all that are cut keep the same number, and shorter ones stay whole. Every
/// window is a log of its own, as old as the session is when it begins; those of one recording follow each other, and
/// all but the first continue it.
/// @param logs with the decimation that they are to have @returns them as they are, where there is room for all, or
/// where some joint moves in no window by a tenth of what it moves in its session
std::vector<SessionLog> in_windows(std::vector<SessionLog> logs, const SessionOptions& options);

/// Samples [from, to) of a log. What a filter's ends or an effect's memory spoil there has to be in it, and be left
/// out: [first, last) are the samples that count, of the part.
ProcessedLog part_of(const ProcessedLog& log, Eigen::Index from, Eigen::Index to, Eigen::Index first,
                     Eigen::Index last);

}  // namespace fxdyn::diagnosis
