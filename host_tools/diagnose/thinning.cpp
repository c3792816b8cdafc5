#include "host_tools/diagnose/thinning.hpp"

#include <algorithm>

#include "host_tools/signals/filter.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// Of the new rate. The filter passes 1e-3 at 15/16 of that rate: what is above folds into the torque's band, which
/// ends at 1/16 (SessionOptions::torque_samples).
constexpr double torque_share = 0.4;

Index kept(Index samples, Index k) { return (samples + k - 1) / k; }

MatrixXd every(const MatrixXd& columns, Index k) {
  if (columns.rows() == 0) return columns;
  return columns(Eigen::seqN(0, kept(columns.rows(), k), k), Eigen::all);
}

}  // namespace

ProcessedLog thinned(ProcessedLog log, Index k) {
  if (k <= 1) return log;
  const double step_s = log.step_s * static_cast<double>(k);
  if (log.tau.size() > 0) log.tau = ZeroPhaseFilter(torque_share / step_s, log.step_s).apply(log.tau);
  for (MatrixXd* columns : {&log.q, &log.measured_dq, &log.measured_ddq, &log.lost_velocity, &log.qlink, &log.tau})
    *columns = every(*columns, k);
  log.t = every(log.t, k);
  log.step_s = step_s;
  log.kept_each *= k;
  log.first = kept(log.first, k);
  log.last = kept(log.last, k);
  log.decimation = std::max<Index>(1, log.decimation / k);
  for (auto& joint : log.saturated) {
    for (auto& run : joint) run = {run[0] / k, kept(run[1], k)};
  }
  return log;
}

}  // namespace fxdyn::diagnosis
