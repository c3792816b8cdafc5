#include "host_tools/regression/split.hpp"

#include <algorithm>

#include "host_tools/regression/row_ranges.hpp"

namespace fxdyn {
namespace {

bool has_validation(const std::vector<LogRows>& logs) {
  return std::any_of(logs.begin(), logs.end(), [](const LogRows& log) { return log.role == Role::validate; });
}

}  // namespace

std::vector<LogBlock> make_blocks(const std::vector<LogRows>& logs) {
  const int parts = has_validation(logs) || logs.size() > 1 ? 1 : blocks_of_one_log;
  std::vector<LogBlock> blocks;
  Eigen::Index first = 0;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const Eigen::Index count = logs[l].rows;
    for (const RowRange& range : cut({first, count}, parts))
      blocks.push_back({l, range.first, range.first + range.count, logs[l].role == Role::train});
    first += count;
  }
  return blocks;
}

Split make_split(const std::vector<LogRows>& logs, const std::vector<LogBlock>& blocks) {
  Split split;
  split.has_validation = has_validation(logs);
  split.kind = split.has_validation ? "validate logs"
               : logs.size() > 1
                   ? "each train log judged by a fit of the others (no log has the role validate)"
                   : "blocks of the train log (no log has the role validate, and there is one trajectory only)";
  const std::size_t folds = split.has_validation ? 1 : blocks.size();
  split.fit.resize(folds);
  split.judge.resize(folds);
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    for (std::size_t fold = 0; fold < folds; ++fold) {
      const bool judges = split.has_validation ? !blocks[b].train : b == fold;
      (judges ? split.judge : split.fit)[fold].push_back(b);
    }
  }
  return split;
}

}  // namespace fxdyn
