#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "host_tools/logs/log.hpp"
#include "host_tools/regression/row_ranges.hpp"

namespace fxdyn {

/// What the rows of a log are for.
struct LogUse {
  Eigen::Index rows = 0;
  bool fits = true;    ///< else it judges what the others fit
  bool judges = true;  ///< where every log fits: its blocks judge fits of all others (not so a healthy session's)
};

/// Some rows of one log, which fit or judge together.
struct LogPart {
  std::size_t log = 0;
  RowRange rows;  ///< of all logs, stacked
};

/// Parts of parts_of(), by their place.
struct Fold {
  std::vector<std::size_t> fit, judge;
};

/// What is left out at a time where all logs fit.
enum class LeaveOut {
  log,          ///< a whole log; blocks_of_one_log of the only one that could judge
  part_of_each  ///< one of blocks_of_one_log of every log that judges: each fit has seen some of every motion
};

/// One part a log, but for the logs that are cut where all logs fit.
std::vector<LogPart> parts_of(const std::vector<LogUse>& logs, LeaveOut leave_out = LeaveOut::log);
/// Where some logs do not fit: one fold, which they judge. Else what is left out is judged by a fit of the others.
std::vector<Fold> folds_of(const std::vector<LogUse>& logs, const std::vector<LogPart>& parts,
                           LeaveOut leave_out = LeaveOut::log);

/// Consecutive rows [from, to) of one log that are fitted or judged together.
struct LogBlock {
  std::size_t log;
  Eigen::Index from, to;  ///< of the rows of all logs, stacked
  bool train;
};

/// Which blocks fit and which judge. With `validate` logs: train fits, validate judges. Without: every train log is
/// judged by a fit of the others; a single one is cut into five contiguous blocks.
struct Split {
  std::vector<std::vector<std::size_t>> fit, judge;  ///< block numbers, one entry a fold
  bool has_validation = false;
  std::string kind;  ///< for people
};

/// Role and number of rows of a log.
struct LogRows {
  Role role;
  Eigen::Index rows;
};
/// One a log; five of a log that is alone and does not validate.
std::vector<LogBlock> make_blocks(const std::vector<LogRows>& logs);
/// Of the blocks that make_blocks() makes of these logs.
Split make_split(const std::vector<LogRows>& logs);

}  // namespace fxdyn
