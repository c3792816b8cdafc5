#include "host_tools/diagnose/evidence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "host_tools/diagnose/forward.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/regression/metrics.hpp"
#include "host_tools/signals/filter.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Sums of squares over the logs' samples, one a joint.
struct Pooled {
  VectorXd squares;
  Index logs = 0;
  double samples = 0;
  void add(const std::vector<JointMetrics>& metrics, double JointMetrics::*of, const ProcessedLog& log) {
    if (squares.size() == 0) squares.setZero(static_cast<Index>(metrics.size()));
    const auto count = static_cast<double>(log.last - log.first);
    for (std::size_t j = 0; j < metrics.size(); ++j)
      squares[static_cast<Index>(j)] += count * metrics[j].*of * metrics[j].*of;
    ++logs;
    samples += count;
  }
  /// None where a log is missing or a figure is not finite.
  std::optional<double> rms(std::size_t joint, std::size_t of_logs) const {
    if (logs == 0 || static_cast<std::size_t>(logs) != of_logs) return {};
    const double value = std::sqrt(squares[static_cast<Index>(joint)] / samples);
    return std::isfinite(value) ? std::optional(value) : std::nullopt;
  }
};

/// Torque over logs as the fixed-point firmware computes it: at the drive's ticks, back to the log's samples, with the
/// log's known load and at the times at which its torque column shows it, samples x joints [N*m | N].
class Firmware {
 public:
  explicit Firmware(const IdentifiedModel& model) : model_(model) {}
  /// @throws DataError where no formats can be chosen for the model.
  Eigen::MatrixXd operator()(const ProcessedLog& log) {
    const ModelValue model = with_load_of(log, model_);
    if (!log.load && !unloaded_) unloaded_ = choose_formats(model);
    const Formats formats = log.load ? choose_formats(model) : *unloaded_;
    const TickStates ticks = at_ticks(log, tick_of(model), true);
    return at_other_times(interpolate(predict_fixed(model, formats, ticks, age_of(model, log)), ticks.t, log.t),
                          filter_of(model).torque_lead_s / log.step_s);
  }

 private:
  const IdentifiedModel& model_;
  std::optional<Formats> unloaded_;
};

/// Samples outside of the limits that the tables hold. Of a setpoint there the firmware's torque is that of another
/// motion; a torque there it cuts off.
class Clamped {
 public:
  explicit Clamped(const IdentifiedModel& model)
      : model_(model), beyond_(Eigen::MatrixXd::Zero(static_cast<Index>(joints_of(model).size()), 4)) {}

  /// @param torque of the model, samples x joints [N*m | N]
  void add(const ProcessedLog& log, const Eigen::MatrixXd& torque) {
    const Index count = log.last - log.first;
    const MotionRows motion = log.motion(log.first, count);
    for (Index k = 0; k < beyond_.rows(); ++k) {
      const JointFit& joint = joints_of(model_)[static_cast<std::size_t>(k)];
      const auto q = motion.q.col(k).array();
      const auto outside = [](const auto& values, double limit) { return (values.abs() > limit).count(); };
      const Index found[] = {(q < joint.q_lower || q > joint.q_upper).count(),
                             outside(motion.dq.col(k).array(), joint.dq_limit),
                             outside(motion.ddq.col(k).array(), joint.ddq_limit),
                             outside(torque.col(k).segment(log.first, count).array(), joint.tau_limit)};
      for (Index i = 0; i < 4; ++i) beyond_(k, i) += static_cast<double>(found[i]);
    }
    samples_ += static_cast<double>(count);
  }
  std::vector<std::string> notes() const {
    // Of the samples. Beyond a position limit gravity is another's; single spikes of derivatives are not worth a word.
    constexpr double worth_a_word[] = {0, 1e-3, 1e-3, 1e-3};
    const char* const names[] = {"position", "velocity", "acceleration", "model's torque"};
    std::vector<std::string> out;
    for (Index k = 0; k < beyond_.rows(); ++k) {
      for (Index i = 0; i < 4; ++i) {
        const double share = beyond_(k, i) / std::max(samples_, 1.0);
        if (share == 0 || share < worth_a_word[i]) continue;
        out.push_back(
            fmt::format("{}: in {:.2g} % of the held-out samples the {} is beyond its limit, where the firmware "
                        "clamps; [limits] sets wider ones",
                        robot_of(model_).joints[static_cast<std::size_t>(k)].name, 100 * share, names[i]));
      }
    }
    return out;
  }

 private:
  const IdentifiedModel& model_;
  Eigen::MatrixXd beyond_;  ///< joints x (position, velocity, acceleration, torque)
  double samples_ = 0;
};

}  // namespace

HeldOutEvidence held_out_evidence(const IdentifiedModel& nominal, const IdentifiedModel& diagnosed,
                                  const std::vector<ProcessedLog>& held_out, const std::vector<bool>& still) {
  HeldOutEvidence out;
  Pooled before, after, fixed, noise;
  Firmware firmware(diagnosed);
  Clamped clamped(diagnosed);
  std::vector<const ProcessedLog*> judged;
  std::optional<std::string> why_not_fixed;
  for (const ProcessedLog& log : held_out) {
    if (log.tau.size() == 0) continue;
    judged.push_back(&log);
    out.held_out.push_back({log.name, log.role, log.from_s, log.to_s});
    before.add(judge(log, predict(nominal, log)), &JointMetrics::rmse, log);
    const Eigen::MatrixXd torque = predict(diagnosed, log);
    clamped.add(log, torque);
    const auto with_effects = judge(log, torque);
    after.add(with_effects, &JointMetrics::rmse, log);
    noise.add(with_effects, &JointMetrics::noise_floor, log);
    if (why_not_fixed) continue;
    // A model that fixed point can't hold is still a diagnosis.
    try {
      fixed.add(judge(log, firmware(log)), &JointMetrics::rmse, log);
    } catch (const DataError& error) {
      why_not_fixed = error.what();
    } catch (const InputError& error) {
      why_not_fixed = error.what();
    }
  }
  if (judged.empty()) {
    out.note = "no log was held out: nothing that the search has not seen";
    out.fixed_point.why_not = "no log was held out";
    return out;
  }
  for (std::size_t j = 0; j < robot_of(diagnosed).size(); ++j) {
    // Of what stands still these logs tell nothing.
    const auto figure = [&](const Pooled& of) {
      return j < still.size() && still[j] ? std::nullopt : of.rms(j, judged.size());
    };
    out.joints.push_back({robot_of(diagnosed).joints[j].name, robot_of(diagnosed).joints[j].torque_unit(),
                          figure(before), figure(after), figure(fixed), figure(noise)});
  }
  out.fixed_point = {!why_not_fixed, why_not_fixed.value_or(""), clamped.notes()};
  out.forward = play_forward(nominal, diagnosed, judged);
  if (held_out.front().role == Role::validate)
    out.note = "no test log: the validate logs fitted nothing, but decided which names stay";
  return out;
}

}  // namespace fxdyn
