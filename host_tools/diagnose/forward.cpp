#include "host_tools/diagnose/forward.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/forward/forward.hpp"
#include "host_tools/simulate/closed_loop.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double longest_s = 20;
/// The plant's friction states start at rest and its motion starts beside the recorded one.
constexpr double settling_s = 1;

/// RMS per joint.
struct Differences {
  VectorXd tracking;  ///< of the position [rad | m]
  VectorXd torque;    ///< that the PD added [N*m | N]
};

Differences play(const IdentifiedModel& model, const ProcessedLog& log, Index count) {
  const MotionRows motion = log.motion(log.first, count);
  const MatrixXd feedforward = log.filter_columns(driving_torque(model, log)).middleRows(log.first, count);
  ClosedLoopSettings settings;
  settings.age_s = age_of(model, log) + static_cast<double>(log.first) * log.step_s;  // as in predict()
  const ClosedLoopRun run =
      run_closed_loop(with_load_of(log, model), {log.step_s, motion.q, motion.dq, motion.ddq, feedforward}, settings);
  if (!run.q.allFinite() || !run.tau.allFinite()) throw DataError("the simulated motion grows without bound");
  const auto settled = std::min<Index>(count / 4, static_cast<Index>(settling_s / log.step_s));
  const Index judged = count - settled;
  const auto rms = [&](const MatrixXd& error) -> VectorXd {
    return error.bottomRows(judged).colwise().norm().transpose() / std::sqrt(static_cast<double>(judged));
  };
  return {rms(run.q - motion.q), rms(log.filter_columns(run.tau - feedforward))};
}

std::optional<double> at(const VectorXd& values, Index j) {
  return values.size() > 0 ? std::optional(values[j]) : std::nullopt;
}

}  // namespace

PlayedForward play_forward(const IdentifiedModel& nominal, const IdentifiedModel& diagnosed,
                           const std::vector<const ProcessedLog*>& logs) {
  const auto length = [](const ProcessedLog* log) { return static_cast<double>(log->last - log->first) * log->step_s; };
  const ProcessedLog& log =
      **std::max_element(logs.begin(), logs.end(), [&](auto* a, auto* b) { return length(a) < length(b); });
  const Index count = std::min(log.last - log.first, static_cast<Index>(std::floor(longest_s / log.step_s + 1e-9)));
  const std::array<const IdentifiedModel*, 2> models{&nominal, &diagnosed};
  std::array<Differences, 2> runs;
  std::array<std::string, 2> why;
  parallel_for(2, [&](std::size_t i) {
    // Not every model is a plant: one that no body of matter has can't be moved forward.
    try {
      runs[i] = play(*models[i], log, count);
    } catch (const DataError& error) {
      why[i] = error.what();
    } catch (const InputError& error) {
      why[i] = error.what();
    }
  });
  const auto& [before, after] = runs;
  PlayedForward out{log.name, log.t[log.first], static_cast<double>(count) * log.step_s, {}, why[0], why[1]};
  for (std::size_t j = 0; j < robot_of(diagnosed).size(); ++j) {
    const Joint& joint = robot_of(diagnosed).joints[j];
    const auto k = static_cast<Index>(j);
    out.joints.push_back({joint.name, joint.position_unit(), joint.torque_unit(), at(before.tracking, k),
                          at(after.tracking, k), at(before.torque, k), at(after.torque, k)});
  }
  return out;
}

}  // namespace fxdyn
