#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/diagnose/session_log.hpp"
#include "host_tools/regression/split.hpp"

namespace fxdyn::diagnosis {

/// Rows that are used or left out together.
struct Block {
  std::size_t log = 0;  ///< the recording's first
  Eigen::Index first = 0, count = 0;
  bool healthy = false, fits = true;
};

/// The rows of all logs, one after the other, as blocks and folds. With validate logs there is one fold, which they
/// judge, and a block is a recording (a log, or all of its windows). Else today's logs are cut: a fold is a part of
/// each of them, judged by a fit of all others; or a whole log is, where the others' motion shows enough to predict it
/// (Linearised decides).
struct Blocks {
  std::vector<Block> all;
  std::vector<Block> of_log;     ///< by log or window: all of its rows
  std::vector<std::size_t> fit;  ///< blocks that fit coefficients
  std::vector<Fold> folds;       ///< places in `all`
  /// Where no log validates and several fit: a log each, judged by a fit of the others.
  std::vector<Fold> whole_logs;

  Eigen::Index rows() const { return of_log.back().first + of_log.back().count; }
  /// Blocks of one session that fit.
  std::vector<std::size_t> fit_of(bool healthy) const;
};

Blocks make_blocks(const std::vector<SessionLog>& logs);

}  // namespace fxdyn::diagnosis
