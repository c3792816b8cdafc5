#include "host_tools/identify/torque_samples.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

/// One sample of each `stride` of the log. The golden ratio spreads them most evenly over any cycle.
std::vector<Index> spread_samples(Index first, Index last, Index stride) {
  constexpr double golden = 0.6180339887498949;
  std::vector<Index> out;
  double share = 0;
  for (Index k = first; k < last; k += stride) {
    const Index at = k + static_cast<Index>(share * static_cast<double>(stride));
    if (at < last) out.push_back(at);
    share += golden;
    share -= std::floor(share);
  }
  return out;
}

/// Whether a drive was at its limit, or so shortly before or after that the filter shows it: the torque is not what the
/// motion asks for.
bool is_saturated(const ProcessedLog& log, Index sample) {
  const Index near = whole_up(1 / (log.filter.torque_cutoff_hz * log.step_s));
  for (const auto& ranges : log.saturated) {
    for (const auto& [from, to] : ranges) {
      if (sample >= from - near && sample < to + near) return true;
    }
  }
  return false;
}

}  // namespace

TorqueSamples sample_torque(std::span<const ProcessedLog> logs, Index wanted, double lead_s) {
  TorqueSamples samples;
  Index available = 0;
  for (const ProcessedLog& log : logs) {
    if (log.role != Role::train) continue;
    available += log.last - log.first;
    samples.independent += 2 * log.filter.torque_cutoff_hz * static_cast<double>(log.last - log.first) * log.step_s;
  }
  const Index stride = std::max<Index>(1, available / wanted);
  std::vector<std::vector<Index>>& at = samples.at;
  Index rows = 0;
  for (const ProcessedLog& log : logs) {
    at.push_back(log.role == Role::train ? spread_samples(log.first, log.last, stride) : std::vector<Index>{});
    std::erase_if(at.back(), [&](Index k) { return is_saturated(log, k); });
    rows += static_cast<Index>(at.back().size());
  }
  const Index joints = logs.front().q.cols();
  for (MatrixXd* columns : {&samples.q, &samples.dq, &samples.ddq, &samples.tau}) columns->resize(rows, joints);
  Index to = 0;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    if (at[l].empty()) continue;
    const auto lead = static_cast<Index>(std::llround(lead_s / logs[l].step_s));
    const auto torque_at = [&](Index k) { return std::clamp(k - lead, logs[l].first, logs[l].last - 1); };
    for (std::size_t k = 0; k < at[l].size(); ++k) {
      const MotionRows motion = logs[l].motion(at[l][k], 1);
      const Index row = to + static_cast<Index>(k);
      samples.q.row(row) = motion.q.row(0);
      samples.dq.row(row) = motion.dq.row(0);
      samples.ddq.row(row) = motion.ddq.row(0);
    }
    // Column by column: a long log's filtered torque is not held for a few hundred of its samples.
    for (Index j = 0; j < joints; ++j) {
      const MatrixXd filtered = logs[l].filter_columns(logs[l].tau.col(j));
      for (std::size_t k = 0; k < at[l].size(); ++k)
        samples.tau(to + static_cast<Index>(k), j) = filtered(torque_at(at[l][k]), 0);
    }
    to += static_cast<Index>(at[l].size());
  }
  return samples;
}

}  // namespace fxdyn
