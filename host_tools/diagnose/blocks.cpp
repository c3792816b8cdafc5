#include "host_tools/diagnose/blocks.hpp"

namespace fxdyn::diagnosis {

namespace {

std::vector<Fold> whole_logs(const Blocks& blocks) {
  std::vector<Fold> out;
  for (std::size_t l = 0; l < blocks.of_log.size(); ++l) {
    if (!blocks.of_log[l].fits) return {};
    if (blocks.of_log[l].healthy) continue;
    Fold& fold = out.emplace_back();
    for (std::size_t b = 0; b < blocks.all.size(); ++b) (blocks.all[b].log == l ? fold.judge : fold.fit).push_back(b);
  }
  if (out.size() < 2) out.clear();
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
  std::vector<LogUse> uses;
  uses.reserve(logs.size());
  for (const SessionLog& entry : logs)
    uses.push_back({.rows = entry.log.rows(), .fits = entry.fits, .judges = !entry.healthy});
  Eigen::Index first = 0;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    out.of_log.push_back({l, first, uses[l].rows, logs[l].healthy, logs[l].fits});
    first += uses[l].rows;
  }
  const std::vector<LogPart> parts = parts_of(uses, LeaveOut::part_of_each);
  for (std::size_t b = 0; b < parts.size(); ++b) {
    const SessionLog& entry = logs[parts[b].log];
    out.all.push_back({parts[b].log, parts[b].rows.first, parts[b].rows.count, entry.healthy, entry.fits});
    if (entry.fits) out.fit.push_back(b);
  }
  out.folds = folds_of(uses, parts, LeaveOut::part_of_each);
  out.whole_logs = whole_logs(out);
  return out;
}

}  // namespace fxdyn::diagnosis
