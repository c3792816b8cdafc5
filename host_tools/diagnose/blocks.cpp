#include "host_tools/diagnose/blocks.hpp"

namespace fxdyn::diagnosis {

namespace {

std::vector<Fold> whole_logs(const Blocks& blocks) {
  std::vector<Fold> out;
  for (const Block& block : blocks.all) {
    if (!block.fits) return {};
    const bool cut = &block != blocks.all.data() && (&block - 1)->log == block.log;
    if (block.healthy || cut) continue;
    Fold& fold = out.emplace_back();
    for (std::size_t b = 0; b < blocks.all.size(); ++b)
      (blocks.all[b].log == block.log ? fold.judge : fold.fit).push_back(b);
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
  Eigen::Index first = 0;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    out.of_log.push_back({l, first, logs[l].log.rows(), logs[l].healthy, logs[l].fits});
    first += out.of_log.back().count;
  }
  const std::vector<std::vector<std::size_t>> recordings = by_recording(logs);
  std::vector<LogUse> uses;
  uses.reserve(recordings.size());
  for (const std::vector<std::size_t>& windows : recordings) {
    LogUse& use = uses.emplace_back();
    use.fits = logs[windows.front()].fits;
    use.judges = !logs[windows.front()].healthy;
    for (const std::size_t l : windows) use.rows += out.of_log[l].count;
  }
  const std::vector<LogPart> parts = parts_of(uses, LeaveOut::part_of_each);
  for (std::size_t b = 0; b < parts.size(); ++b) {
    const std::size_t log = recordings[parts[b].log].front();
    const SessionLog& entry = logs[log];
    out.all.push_back({log, parts[b].rows.first, parts[b].rows.count, entry.healthy, entry.fits});
    if (entry.fits) out.fit.push_back(b);
  }
  out.folds = folds_of(uses, parts, LeaveOut::part_of_each);
  out.whole_logs = whole_logs(out);
  return out;
}

}  // namespace fxdyn::diagnosis
