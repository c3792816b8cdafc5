#include "host_tools/diagnose/windows.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace fxdyn::diagnosis {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;

/// Of many logs each may keep little: no window is shorter.
constexpr double shortest_window_s = 4;

/// Rows that a recording may keep, so that all together keep `room`: those that have fewer stay whole.
double most_rows_each(const std::vector<SessionLog>& logs, double room) {
  std::vector<double> rows;
  rows.reserve(logs.size());
  for (const SessionLog& entry : logs) rows.push_back(static_cast<double>(entry.log.rows()));
  std::sort(rows.begin(), rows.end());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double each = room / static_cast<double>(rows.size() - i);
    if (rows[i] > each) return each;
    room -= rows[i];
  }
  return rows.empty() ? 0 : rows.back();
}

/// The windows of one recording, of `most` rows together; the recording itself where it has no more.
void cut(const SessionLog& entry, double most, const SessionOptions& options, std::vector<SessionLog>& out) {
  const ProcessedLog& log = entry.log;
  const auto samples_of = [&](double seconds) { return static_cast<Index>(std::lround(seconds / log.step_s)); };
  const Index whole = log.last - log.first;
  const auto kept = static_cast<Index>(std::lround(most * static_cast<double>(log.decimation)));
  const Index length = std::max(samples_of(shortest_window_s), std::min(samples_of(options.window_s), kept));
  const Index count = std::max<Index>(1, kept / length);
  if (whole <= kept || count * length >= whole) {
    out.push_back(entry);
    return;
  }
  const Index margin = std::max(log.first, samples_of(options.run_in_s));
  for (Index w = 0; w < count; ++w) {
    // In the middle of its part of the log.
    const Index begin = log.first + (2 * w + 1) * whole / (2 * count) - length / 2, end = begin + length;
    const Index from = std::max<Index>(0, begin - margin), to = std::min(log.samples(), end + margin);
    SessionLog window;
    window.log = part_of(log, from, to, begin - from, end - from);
    window.healthy = entry.healthy;
    window.fits = entry.fits;
    window.continues = w > 0;
    window.age_s = entry.age_s + window.log.ran_s - log.ran_s;
    window.bending_hz = entry.bending_hz;
    out.push_back(std::move(window));
  }
}

/// How far each joint moves in the logs of a session that fit [rad | m].
ArrayXd ranges(const std::vector<SessionLog>& logs, bool healthy) {
  ArrayXd low, high;
  for (const SessionLog& entry : logs) {
    if (entry.healthy != healthy || !entry.fits) continue;
    const auto q = entry.log.q.middleRows(entry.log.first, entry.log.last - entry.log.first).array();
    const ArrayXd least = q.colwise().minCoeff().transpose(), most = q.colwise().maxCoeff().transpose();
    low = low.size() == 0 ? least : ArrayXd(low.min(least));
    high = high.size() == 0 ? most : ArrayXd(high.max(most));
  }
  return high - low;
}

bool all_move(const std::vector<SessionLog>& windows, const std::vector<SessionLog>& logs, double least) {
  for (const bool healthy : {false, true}) {
    if (!(ranges(windows, healthy) >= least * ranges(logs, healthy)).all()) return false;
  }
  return true;
}

}  // namespace

std::vector<std::vector<std::size_t>> by_recording(const std::vector<SessionLog>& logs) {
  std::vector<std::vector<std::size_t>> out;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    if (!logs[l].continues) out.emplace_back();
    out.back().push_back(l);
  }
  return out;
}

ProcessedLog part_of(const ProcessedLog& log, Index from, Index to, Index first, Index last) {
  const auto part = [&](const MatrixXd& columns) {
    return columns.size() == 0 ? columns : MatrixXd(columns.middleRows(from, to - from));
  };
  ProcessedLog out;
  for (MatrixXd ProcessedLog::*columns : {&ProcessedLog::q, &ProcessedLog::measured_dq, &ProcessedLog::measured_ddq,
                                          &ProcessedLog::lost_velocity, &ProcessedLog::qlink, &ProcessedLog::tau})
    out.*columns = part(log.*columns);
  out.t = log.t.segment(from, to - from);
  out.name = log.name;
  out.role = log.role;
  out.from_s = out.t[0];
  out.to_s = out.t[out.t.size() - 1];
  out.step_s = log.step_s;
  out.ran_s = log.ran_s + out.t[0] - log.t[0];
  out.has_link = log.has_link;
  out.load = log.load;
  out.q_range = log.q_range;
  out.q_noise = log.q_noise;
  out.torque_noise = log.torque_noise;
  out.saturated = log.saturated;
  out.left_out = log.left_out;
  out.first = first;
  out.last = last;
  out.kept_each = log.kept_each;
  out.decimation = log.decimation;
  out.filter = log.filter;
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
  double joint_rows = 0;
  for (const SessionLog& entry : logs) joint_rows += static_cast<double>(entry.log.rows() * entry.log.q.cols());
  if (joint_rows <= options.most_rows) return logs;
  const ProcessedLog& any = logs.front().log;
  const double rows_a_second = 1 / (any.step_s * static_cast<double>(any.decimation));  // alike in all of them
  const double room =
      std::max(options.most_rows / static_cast<double>(any.q.cols()), options.least_kept_s * rows_a_second);
  const double most = most_rows_each(logs, room);
  std::vector<SessionLog> out;
  for (const SessionLog& entry : logs) cut(entry, most, options, out);
  return all_move(out, logs, options.least_in_windows) ? out : logs;
}

}  // namespace fxdyn::diagnosis
