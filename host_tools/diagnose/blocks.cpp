#include "host_tools/diagnose/blocks.hpp"

#include <algorithm>

#include "host_tools/regression/row_ranges.hpp"

namespace fxdyn::diagnosis {
namespace {

std::vector<Fold> folds_of(const Blocks& blocks, bool validated) {
  std::vector<std::vector<std::size_t>> judges;
  if (validated) {
    judges.resize(1);
    for (std::size_t b = 0; b < blocks.all.size(); ++b) {
      if (!blocks.all[b].fits) judges[0].push_back(b);
    }
  } else {
    // The next part of every log in turn: each fold fits some of every motion there is.
    judges.resize(blocks_of_one_log);
    std::size_t place = 0;
    for (std::size_t b = 0; b < blocks.all.size(); ++b) {
      if (b > 0 && blocks.all[b].log != blocks.all[b - 1].log) place = 0;
      if (!blocks.all[b].healthy) judges[place++].push_back(b);
    }
    std::erase_if(judges, [](const std::vector<std::size_t>& judge) { return judge.empty(); });
  }
  std::vector<Fold> out;
  for (const std::vector<std::size_t>& judge : judges) {
    Fold fold{{}, judge};
    for (const std::size_t b : blocks.fit) {
      if (std::find(judge.begin(), judge.end(), b) == judge.end()) fold.fit.push_back(b);
    }
    out.push_back(fold);
  }
  return out;
}

}  // namespace

std::vector<std::size_t> Blocks::fit_of(bool healthy) const {
  std::vector<std::size_t> out;
  for (const std::size_t b : fit) {
    if (all[b].healthy == healthy) out.push_back(b);
  }
  return out;
}

Blocks make_blocks(const std::vector<SessionLog>& logs) {
  Blocks out;
  const bool validated = std::any_of(logs.begin(), logs.end(), [](const SessionLog& entry) { return !entry.fits; });
  Eigen::Index first = 0;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const SessionLog& entry = logs[l];
    const Eigen::Index count = entry.log.rows();
    out.of_log.push_back({l, first, count, entry.healthy, entry.fits});
    const int parts = !validated && !entry.healthy ? blocks_of_one_log : 1;
    for (const RowRange& range : cut({first, count}, parts))
      out.all.push_back({l, range.first, range.count, entry.healthy, entry.fits});
    first += count;
  }
  for (std::size_t b = 0; b < out.all.size(); ++b) {
    if (out.all[b].fits) out.fit.push_back(b);
  }
  out.folds = folds_of(out, validated);
  return out;
}

}  // namespace fxdyn::diagnosis
