#include "host_tools/diagnose/plain_error.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// Squares of the filtered error on today's logs that fit, or on those that judge only.
VectorXd squares_of(const IdentifiedModel& model, const std::vector<SessionLog>& logs, bool fitted) {
  std::vector<VectorXd> squares(logs.size());
  parallel_for(logs.size(), [&](std::size_t l) {
    if (logs[l].fits != fitted || logs[l].healthy) return;
    const ProcessedLog& log = logs[l].log;
    const MatrixXd error = log.filter_columns(log.tau - predict(model, log));
    squares[l] = error.middleRows(log.first, log.last - log.first).colwise().squaredNorm().transpose();
  });
  VectorXd sum;
  for (const VectorXd& square : squares) {
    if (square.size() > 0) sum = sum.size() > 0 ? VectorXd(sum + square) : square;
  }
  return sum;
}

bool are_validated(const std::vector<SessionLog>& logs) {
  return std::any_of(logs.begin(), logs.end(), [](const SessionLog& log) { return !log.fits; });
}

}  // namespace

VectorXd plain_error(const IdentifiedModel& model, const std::vector<SessionLog>& logs) {
  return squares_of(model, logs, false);
}

std::vector<bool> harmed_joints(const GateOptions& options, const IdentifiedModel& before, const IdentifiedModel& after,
                                const std::vector<SessionLog>& logs) {
  const bool validated = are_validated(logs);
  const VectorXd of_before = squares_of(before, logs, !validated), of_after = squares_of(after, logs, !validated);
  const double most = validated ? options.worse : options.worse_fitted;
  std::vector<bool> out;
  for (Index j = 0; j < of_after.size(); ++j) out.push_back(!(of_after[j] <= most * most * of_before[j]));
  return out;
}

bool is_worse(const GateOptions& options, const VectorXd& before, const VectorXd& after, Index joint) {
  return before.size() > 0 && after[joint] > options.worse * options.worse * before[joint];
}

std::size_t count_harmed(const GateOptions& options, const IdentifiedModel& before, const IdentifiedModel& after,
                         const std::vector<SessionLog>& logs) {
  const std::vector<bool> harmed = harmed_joints(options, before, after, logs);
  return static_cast<std::size_t>(std::count(harmed.begin(), harmed.end(), true));
}

}  // namespace fxdyn::diagnosis
