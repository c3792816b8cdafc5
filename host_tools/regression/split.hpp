#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "host_tools/signals/log.hpp"

namespace fxdyn {

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
/// `blocks`: make_blocks() of these logs.
Split make_split(const std::vector<LogRows>& logs, const std::vector<LogBlock>& blocks);

}  // namespace fxdyn
