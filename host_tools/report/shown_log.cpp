#include "host_tools/report/shown_log.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "host_tools/report/section.hpp"
#include "host_tools/signals/spectrum.hpp"

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd shown_torque(const IdentifiedModel& model, const ProcessedLog& log) {
  return log.filter_columns(predict(model, log)).middleRows(log.first, log.last - log.first);
}

std::vector<ShownLog> shown_logs(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs) {
  const std::vector<MatrixXd> loads = structural_torque(model, logs);
  std::vector<ShownLog> out;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const ProcessedLog& log = logs[l];
    const Index count = log.last - log.first;
    if (log.tau.size() == 0 || count <= 0) continue;
    MotionRows motion = log.motion(log.first, count);
    const MatrixXd measured = log.filter_columns(log.tau).middleRows(log.first, count);
    const MatrixXd predicted = shown_torque(model, log);
    out.push_back({&log, log.t.segment(log.first, count), std::move(motion.q), std::move(motion.dq),
                   std::move(motion.ddq), measured, predicted, measured - predicted,
                   log.filter_columns(loads[l]).middleRows(log.first, count)});
  }
  return out;
}

const std::vector<ShownLog>& shown_logs(const ReportInput& input) {
  if (!input.shown) input.shown = std::make_shared<const std::vector<ShownLog>>(shown_logs(input.fitted, input.logs));
  return *input.shown;
}

VectorXd joined(const std::vector<VectorXd>& columns) {
  Index rows = 0;
  for (const VectorXd& one : columns) rows += one.size() + 1;
  VectorXd out = VectorXd::Constant(rows, std::numeric_limits<double>::quiet_NaN());
  Index row = 0;
  for (const VectorXd& one : columns) {
    out.segment(row, one.size()) = one;
    row += one.size() + 1;
  }
  return out;
}

VectorXd joined(const std::vector<ShownLog>& logs, MatrixXd ShownLog::*of, Index joint) {
  std::vector<VectorXd> columns;
  for (const ShownLog& one : logs) columns.emplace_back((one.*of).col(joint));
  return joined(columns);
}

Trace spectrum_curve(const VectorXd& residual, const ProcessedLog& log, const char* colour, const char* title) {
  constexpr double shown_cutoffs = 1.5;
  const Spectrum spectrum = welch(residual, log.step_s);
  const Index bins =
      std::min(spectrum.density.size() - 1,
               static_cast<Index>(shown_cutoffs * log.filter.torque_cutoff_hz / spectrum.resolution_hz) + 1);
  Trace out{VectorXd(bins), VectorXd(bins), colour, 1.4, title};
  for (Index k = 0; k < bins; ++k) {
    out.x[k] = spectrum.frequency(k + 1);
    out.y[k] = std::sqrt(std::max(spectrum.density[k + 1], 1e-30));
  }
  return out;
}

std::vector<Trace> noise_curve(const ProcessedLog& log, Index joint) {
  const double noise = log.torque_noise.size() > joint ? log.torque_noise[joint] : 0;
  const double cutoff = log.filter.torque_cutoff_hz;
  if (!(noise > 0) || !(cutoff > 0)) return {};
  const double level = noise / std::sqrt(std::min(cutoff, 0.5 / log.step_s));
  return {{Eigen::Vector2d(0, cutoff), Eigen::Vector2d(level, level), "#888888", 1.4, "noise"}};
}

}  // namespace fxdyn
