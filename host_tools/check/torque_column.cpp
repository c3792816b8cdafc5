#include "host_tools/check/torque_column.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "host_tools/check/arrangement.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/effects.hpp"

namespace fxdyn {
namespace {

struct Explained {
  double nats = 0, left = 0, most = 0;
  bool enough = false;
};

/// How well the URDF as it is explains the samples; `left`: share of the torque's RMS that stays, mean over joints;
/// `most`: of the joint that it explains least.
Explained explain(const Robot& robot, const TorqueSamples& samples, const ArrangementOptions& options,
                  FrictionMemory memory = {}) {
  const ArrangementEvidence evidence(robot, samples, options, std::move(memory));
  Explained out;
  out.enough = evidence.enough();
  if (!out.enough) return out;
  const ArrangementScore score = evidence(as_given(robot));
  out.nats = score.nats;
  double joints = 0;
  for (Eigen::Index j = 0; j < score.rms.size(); ++j) {
    const double size = std::sqrt(samples.tau.col(j).squaredNorm() / static_cast<double>(samples.size()));
    if (!evidence.moves(j) || !(size > 0)) continue;
    out.left += score.rms[j] / size;
    out.most = std::max(out.most, score.rms[j] / size);
    ++joints;
  }
  out.left /= std::max(1.0, joints);
  return out;
}

/// Friction with a memory at the samples. Its state needs the whole way there; filtered as the torque is.
FrictionMemory friction_memory(const Robot& robot, const std::vector<ProcessedLog>& logs,
                               const TorqueSamples& samples) {
  if (samples.size() == 0) return {};
  const EffectInfo& effect = presliding_effect();
  FrictionMemory out;
  for (std::size_t j = 0; j < robot.size(); ++j) {
    const auto joint = static_cast<Eigen::Index>(j);
    MotionScales scales;
    scales.turns = robot.joints[j].type == JointType::revolute;
    const auto paths = effect.shape[0].values.judged(scales);
    out.emplace_back(samples.size(), static_cast<Eigen::Index>(paths.size()));
    const double width = std::max(0.02 * samples.dq.col(joint).cwiseAbs().maxCoeff(), 1e-9);
    Eigen::Index row = 0;
    for (std::size_t l = 0; l < logs.size(); ++l) {
      const std::vector<Eigen::Index>& at = samples.at[l];
      if (at.empty()) continue;
      JointSeries series;
      series.dq = logs[l].joint_velocity(joint);
      series.step_s = logs[l].step_s;
      series.q = series.ddq = Eigen::VectorXd::Zero(series.dq.size());
      for (std::size_t i = 0; i < paths.size(); ++i) {
        const Eigen::MatrixXd column =
            logs[l].filter_columns(effect_columns(effect.name, {&paths.begin()[i], 1}, width, series));
        for (std::size_t k = 0; k < at.size(); ++k)
          out.back()(row + static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(i)) = column(at[k], 0);
      }
      row += static_cast<Eigen::Index>(at.size());
    }
  }
  return out;
}

}  // namespace

std::optional<TorqueLead> find_long_torque_lead(const Project& project, const std::vector<ProcessedLog>& logs,
                                                const ArrangementOptions& options) {
  const double known = project.signals.torque_lead_s.value_or(0);
  const FrictionMemory memory = friction_memory(project.robot, logs, sample_torque(logs, options.samples, known));
  const auto at = [&](double more) {
    return explain(project.robot, sample_torque(logs, options.samples, known + more), options, memory);
  };
  const Explained given = at(0);
  if (!given.enough) return {};
  Explained best = given;
  double lead = 0;
  const auto attempt = [&](double seconds) {
    if (std::fabs(known + seconds) > options.longest_lead_s) return;
    const Explained next = at(seconds);
    if (next.nats >= best.nats) return;
    best = next;
    lead = seconds;
  };
  double step = options.least_lead_s;
  while (step <= options.longest_lead_s) {
    for (const double sign : {1.0, -1.0}) attempt(sign * step);
    step *= 2;
  }
  if (lead == 0) return {};
  step = std::fabs(lead) / 2;
  while (step > options.least_lead_s / 10) {
    const double centre = lead;
    attempt(centre + step);
    attempt(centre - step);
    step /= 2;
  }
  if (given.nats - best.nats < options.gain || std::fabs(lead) < options.least_lead_s) return {};
  if (best.left > options.lead_leaves * given.left) return {};
  return TorqueLead{known + lead, given.left, best.left, given.nats - best.nats};
}

double torque_lead_nats(const Project& project, const std::vector<ProcessedLog>& logs, double seconds,
                        const ArrangementOptions& options) {
  const TorqueSamples samples = sample_torque(logs, options.samples, seconds);
  return explain(project.robot, samples, options, friction_memory(project.robot, logs, samples)).nats;
}

std::optional<MeasuredLead> torque_lead(const Project& project, const std::vector<ProcessedLog>& logs,
                                        const ArrangementOptions& options) {
  const double known = project.signals.torque_lead_s.value_or(0), step = options.least_lead_s;
  std::array<double, 3> square{};
  for (std::size_t i = 0; i < square.size(); ++i) {
    const double seconds = known + (static_cast<double>(i) - 1) * step;
    const Explained one = explain(project.robot, sample_torque(logs, options.samples, seconds), options);
    if (!one.enough) return {};
    square[i] = one.left * one.left;
  }
  const double bend = square[0] - 2 * square[1] + square[2];
  const double vertex = bend > 0 ? step * (square[0] - square[2]) / (2 * bend) : INFINITY;
  if (std::fabs(vertex) > step) return {};
  return MeasuredLead{known + vertex, step * std::sqrt(2 * options.blurred * square[1] / bend)};
}

bool is_unexplained(const Project& project, const std::vector<ProcessedLog>& logs, const ArrangementOptions& options) {
  const Explained given = explain(project.robot, sample_torque(logs, options.samples), options);
  return given.enough && given.most > options.unexplained;
}

double disagreement(const Robot& robot, const TorqueSamples& train, const TorqueSamples& log,
                    const ArrangementOptions& options) {
  TorqueSamples both = train;
  const auto append = [](const Eigen::MatrixXd& more, Eigen::MatrixXd& to) {
    to.conservativeResize(to.rows() + more.rows(), Eigen::NoChange);
    to.bottomRows(more.rows()) = more;
  };
  append(log.q, both.q);
  append(log.dq, both.dq);
  append(log.ddq, both.ddq);
  append(log.tau, both.tau);
  both.independent += log.independent;
  const Arrangement given = as_given(robot);
  const ArrangementEvidence alone(robot, train, options), together(robot, both, options);
  double out = 1;
  if (!alone.enough()) return out;
  const Eigen::VectorXd before = alone(given).rms, after = together(given).rms;
  for (Eigen::Index j = 0; j < before.size(); ++j) {
    const double size = std::sqrt(train.tau.col(j).squaredNorm() / static_cast<double>(train.size()));
    if (alone.moves(j)) out = std::max(out, after[j] / std::max(before[j], options.perfect * size));
  }
  return out;
}

bool are_exchanged(const Project& project, const std::vector<Log>& train, const ArrangementOptions& options) {
  const auto left = [&](bool exchanged) {
    std::vector<Log> logs = train;
    for (Log& log : logs) {
      if (log.tau.size() == 0) return 1.0;
      if (!exchanged) continue;
      std::swap(log.q, log.tau);
      for (Eigen::MatrixXd* rates : {&log.dq, &log.ddq, &log.qlink}) rates->resize(0, 0);
      log.encoder_step.resize(0);
    }
    const FilterFit filter = choose_filter(logs, {});
    std::vector<ProcessedLog> processed;
    processed.reserve(logs.size());
    for (Log& log : logs) processed.push_back(process(std::move(log), filter));
    const Explained explained = explain(project.robot, sample_torque(processed, options.samples), options);
    return explained.enough ? explained.left : 1.0;
  };
  const double given = left(false);
  return given > options.unexplained && left(true) < options.explained;
}

}  // namespace fxdyn
