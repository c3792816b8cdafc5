#include "host_tools/diagnose/encoder_error.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/logs/log.hpp"
#include "host_tools/signals/filter.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// At the recording's own rate: `each` samples in place of one, in a straight line to the next.
VectorXd at_recorded_rate(const VectorXd& q, Index each) {
  if (each <= 1) return q;
  VectorXd out((q.size() - 1) * each + 1);
  for (Index k = 0; k + 1 < q.size(); ++k) {
    for (Index i = 0; i < each; ++i)
      out[k * each + i] = q[k] + (q[k + 1] - q[k]) * static_cast<double>(i) / static_cast<double>(each);
  }
  out[out.size() - 1] = q[q.size() - 1];
  return out;
}

}  // namespace

std::optional<MotionRows> see_again(ProcessedLog& log) {
  constexpr double of_motion = 0.4;  // of the torque's cut-off, which is five times the frequency of the motion
  const std::vector<double>& steps = log.filter.encoder_step;
  const bool coarse = std::any_of(steps.begin(), steps.end(), [](double step) { return step > 0; });
  if (!coarse || log.measured_dq.size() > 0) return {};
  const Index each = std::max<Index>(1, log.kept_each);
  const ZeroPhaseFilter smooth(of_motion * log.filter.torque_cutoff_hz, log.step_s),
      recorded(log.filter.position_cutoff_hz, log.step_s / static_cast<double>(each));
  log.q = smooth.apply(log.q);
  MotionRows moved = log.motion();
  for (Index j = 0; j < log.q.cols(); ++j) {
    const double step = steps[static_cast<std::size_t>(j)];
    if (!(step > 0)) continue;
    const VectorXd q = at_recorded_rate(log.q.col(j), each);
    // Not the smooth motion: the filter would take some of it.
    const VectorXd error = (q.array() / step).round() * step - q.array();
    const VectorXd filtered = recorded.apply(error).col(0);
    log.q.col(j) += filtered(Eigen::seqN(0, log.q.rows(), each));
  }
  return moved;
}

}  // namespace fxdyn::diagnosis
