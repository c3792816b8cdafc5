#include "host_tools/diagnose/windows.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "host_tools/signals/whole.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

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

Window whole_of(const ProcessedLog& log) { return {0, log.samples(), log.first, log.last}; }

/// The windows of one recording, of `most` rows together; the recording itself where it has no more.
std::vector<Window> cut(const ProcessedLog& log, double most, const SessionOptions& options) {
  const auto samples_of = [&](double seconds) { return static_cast<Index>(std::lround(seconds / log.step_s)); };
  const Index whole = log.last - log.first;
  const auto kept = static_cast<Index>(std::lround(most * static_cast<double>(log.decimation)));
  const Index length = std::max(samples_of(shortest_window_s), std::min(samples_of(options.window_s), kept));
  const Index count = std::max<Index>(1, kept / length);
  if (whole <= kept || count * length >= whole) return {whole_of(log)};
  std::vector<Window> out;
  const Index margin = std::max(log.first, samples_of(options.run_in_s));
  for (Index w = 0; w < count; ++w) {
    // In the middle of its part of the log.
    const Index begin = log.first + (2 * w + 1) * whole / (2 * count) - length / 2, end = begin + length;
    const Index from = std::max<Index>(0, begin - margin), to = std::min(log.samples(), end + margin);
    out.push_back({from, to, begin - from, end - from});
  }
  return out;
}

}  // namespace

void Ranges::add(const SessionLog& entry, Index joint, const Eigen::Ref<const VectorXd>& q) {
  if (!entry.fits) return;
  const auto inside = q.segment(entry.log.first, entry.log.last - entry.log.first);
  auto& [low, high] = of_[entry.healthy];
  low[joint] = std::min(low[joint], inside.minCoeff());
  high[joint] = std::max(high[joint], inside.maxCoeff());
}

bool Ranges::reach(double share, const Ranges& others) const {
  const auto range = [](const auto& of) -> ArrayXd { return (of[1] - of[0]).max(0); };
  return (range(of_[0]) >= share * range(others.of_[0])).all() && (range(of_[1]) >= share * range(others.of_[1])).all();
}

std::vector<std::vector<std::size_t>> by_recording(const std::vector<SessionLog>& logs) {
  std::vector<std::vector<std::size_t>> out;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    if (!logs[l].log.continues) out.emplace_back();
    out.back().push_back(l);
  }
  return out;
}

ProcessedLog part_of(const ProcessedLog& log, Index from, Index to, Index first, Index last) {
  const auto part = [&](const MatrixXd& columns) {
    return columns.rows() == 0 ? columns : MatrixXd(columns.middleRows(from, to - from));
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

std::vector<ProcessedLog> windows_as_recorded(const std::vector<ProcessedLog>& recorded,
                                              const std::vector<SessionLog>& logs, const SessionOptions& options) {
  if (std::none_of(logs.begin(), logs.end(), [](const SessionLog& l) { return l.window && !l.healthy; })) return {};
  const std::vector<std::vector<std::size_t>> windows = by_recording(logs);
  std::vector<ProcessedLog> out;
  for (std::size_t r = 0; r < recorded.size(); ++r) {
    const ProcessedLog& log = recorded[r];
    const auto sample_at = [&](double t) {
      return std::clamp<Index>(std::lround((t - log.t[0]) / log.step_s), log.first, log.last);
    };
    const Index margin = std::max(log.first, whole_up(options.run_in_s / log.step_s));
    for (const std::size_t l : windows[r]) {
      const ProcessedLog& seen = logs[l].log;
      if (!logs[l].window) {
        out.push_back(log);
        continue;
      }
      const Index begin = sample_at(seen.t[seen.first]);
      const Index end = std::min(sample_at(seen.t[seen.last - 1]) + 1, log.last);
      const Index from = std::max<Index>(0, begin - margin), to = std::min(log.samples(), end + margin);
      out.push_back(part_of(log, from, to, begin - from, end - from));
      out.back().continues = seen.continues;
      // The whole log's rows may be far apart: it has many.
      const Index searched = std::lround(static_cast<double>(seen.decimation) * seen.step_s / log.step_s);
      out.back().decimation = std::clamp<Index>(searched, 1, log.decimation);
    }
  }
  return out;
}

std::vector<std::vector<Window>> plan_windows(const std::vector<SessionLog>& logs, Index joints,
                                              const SessionOptions& options) {
  double joint_rows = 0;
  for (const SessionLog& entry : logs) joint_rows += static_cast<double>(entry.log.rows() * joints);
  double most = joint_rows;
  if (joint_rows > options.most_rows) {
    const ProcessedLog& any = logs.front().log;
    const double rows_a_second = 1 / (any.step_s * static_cast<double>(any.decimation));  // alike in all of them
    most = most_rows_each(
        logs, std::max(options.most_rows / static_cast<double>(joints), options.least_kept_s * rows_a_second));
  }
  std::vector<std::vector<Window>> out;
  out.reserve(logs.size());
  for (const SessionLog& entry : logs) out.push_back(cut(entry.log, most, options));
  return out;
}

std::vector<std::vector<Window>> whole_logs(const std::vector<SessionLog>& logs) {
  std::vector<std::vector<Window>> out;
  out.reserve(logs.size());
  for (const SessionLog& entry : logs) out.push_back({whole_of(entry.log)});
  return out;
}

std::vector<SessionLog> in_windows(const SessionLog& entry, const std::vector<Window>& windows) {
  if (windows.size() == 1 && windows.front().from == 0 && windows.front().to == entry.log.samples()) return {entry};
  std::vector<SessionLog> out;
  for (const Window& w : windows) {
    SessionLog& window = out.emplace_back();
    window.log = part_of(entry.log, w.from, w.to, w.first, w.last);
    window.healthy = entry.healthy;
    window.fits = entry.fits;
    window.window = true;
    window.log.continues = out.size() > 1;
    window.age_s = entry.age_s + window.log.ran_s - entry.log.ran_s;
    window.bending_hz = entry.bending_hz;
  }
  return out;
}

}  // namespace fxdyn::diagnosis
