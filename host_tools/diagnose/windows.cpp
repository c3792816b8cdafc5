#include "host_tools/diagnose/windows.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// Rows of all joints.
double size_of(const std::vector<SessionLog>& logs) {
  double rows = 0;
  for (const SessionLog& entry : logs) rows += static_cast<double>(entry.log.rows() * entry.log.q.cols());
  return rows;
}

/// The windows of one log that together keep `share` of its rows; the log itself where that is one window or more
/// than there is.
void cut(const SessionLog& entry, double share, const SessionOptions& options, std::vector<SessionLog>& out) {
  const ProcessedLog& log = entry.log;
  const auto samples_of = [&](double seconds) { return static_cast<Index>(std::lround(seconds / log.step_s)); };
  const Index whole = log.last - log.first, length = samples_of(options.window_s);
  const auto kept = static_cast<Index>(std::lround(share * static_cast<double>(whole)));
  const Index count = std::max<Index>(1, kept / std::max<Index>(1, length));
  if (count * length >= whole) {
    out.push_back(entry);
    return;
  }
  const Index margin = std::max(log.first, samples_of(options.run_in_s));
  for (Index w = 0; w < count; ++w) {
    // In the middle of its part of the log.
    const Index begin = log.first + (2 * w + 1) * whole / (2 * count) - length / 2, end = begin + length;
    const Index from = std::max<Index>(0, begin - margin), to = std::min(log.samples(), end + margin);
    SessionLog window = entry;
    window.cache = std::make_shared<RowCache>();
    window.log = part_of(log, from, to, begin - from, end - from);
    window.age_s = entry.age_s + log.t[from] - log.t[0];
    out.push_back(std::move(window));
  }
}

}  // namespace

ProcessedLog part_of(const ProcessedLog& log, Index from, Index to, Index first, Index last) {
  const auto part = [&](const MatrixXd& columns) {
    return columns.size() == 0 ? columns : MatrixXd(columns.middleRows(from, to - from));
  };
  ProcessedLog out = log;
  for (MatrixXd ProcessedLog::*columns : {&ProcessedLog::q, &ProcessedLog::measured_dq, &ProcessedLog::measured_ddq,
                                          &ProcessedLog::qlink, &ProcessedLog::tau})
    out.*columns = part(log.*columns);
  out.t = log.t.segment(from, to - from);
  out.from_s = out.t[0];
  out.to_s = out.t[out.t.size() - 1];
  out.first = first;
  out.last = last;
  for (auto& runs : out.saturated) {
    std::erase_if(runs, [&](const std::array<Index, 2>& run) { return run[1] <= from || run[0] >= to; });
    for (auto& [begin, end] : runs) {
      begin = std::max(begin, from) - from;
      end = std::min(end, to) - from;
    }
  }
  return out;
}

std::vector<SessionLog> in_windows(std::vector<SessionLog> logs, const SessionOptions& options) {
  const double size = size_of(logs);
  if (size <= options.most_rows) return logs;
  std::vector<SessionLog> out;
  for (const SessionLog& entry : logs) cut(entry, options.most_rows / size, options, out);
  return out;
}

}  // namespace fxdyn::diagnosis
