#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_tools/check/check.hpp"
#include "host_tools/support/time_text.hpp"

namespace fxdyn {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

/// Samples of a window.
Index window_of(const Log& log, double window_s) {
  return std::clamp<Index>(static_cast<Index>(std::ceil(window_s / log.step_s)), 1,
                           std::max<Index>(1, log.samples() / 4));
}

/// How fast a joint is over a window: single steps of a coarse encoder are no motion, nor is its noise.
VectorXd coarse_speed(const Log& log, Index joint, Index window) {
  const Index rows = log.samples() - window;
  const auto q = log.q.col(joint);
  return ((q.tail(rows) - q.head(rows)) / (static_cast<double>(window) * log.step_s)).cwiseAbs();
}

/// Deviation of white noise of a position, from the median of its third differences, of which motion has next to none.
double noise_of(const Eigen::Ref<const VectorXd>& q) {
  const Index n = q.size() - 3;
  if (n < 8) return 0;
  const VectorXd third = q.tail(n) - 3 * q.segment(2, n) + 3 * q.segment(1, n) - q.head(n);
  std::vector<double> size(third.size());
  std::transform(third.begin(), third.end(), size.begin(), [](double x) { return std::fabs(x); });
  std::nth_element(size.begin(), size.begin() + n / 2, size.end());
  constexpr double median_of_normal = 0.6745;
  return size[static_cast<std::size_t>(n / 2)] / (median_of_normal * std::sqrt(20.0));
}

std::string of_joint(const Robot& robot, Index j) {
  return fmt::format("joint {} ({})", j + 1, robot.joints[static_cast<std::size_t>(j)].name);
}

void add_rest(const LogFacts& log, const LogFactOptions& options, double begin, double end,
              std::vector<CheckFinding>& out) {
  const bool front = log.rest_until_s - begin > options.rest, back = end - log.rest_from_s > options.rest;
  if (!front && !back) return;
  std::string text, fix;
  if (front) {
    text = fmt::format("at rest from {} to {} s", time_text(begin), time_text(log.rest_until_s));
    fix = "from_s = " + time_text(log.rest_until_s);
  }
  if (back) {
    text += fmt::format("{}at rest from {} to {} s", front ? ", " : "", time_text(log.rest_from_s), time_text(end));
    fix += fmt::format("{}to_s = {}", front ? "\n" : "", time_text(log.rest_from_s));
  }
  text += ": stiction holds any torque there, and the fit takes it for friction";
  out.push_back({false, "rest", {}, log.name, text, fix});
}

/// A slide that goes much further than its rail is long.
CheckFinding too_long(const Robot& robot, Index j, double lower, double upper) {
  const Limits& limits = *robot.joints[static_cast<std::size_t>(j)].limits;
  const double range = limits.upper - limits.lower;
  // What remains of the rail in mm; next to nothing: cm.
  const double gain = 1e-3 * (upper - lower) > 0.02 * range ? 1e-3 : 1e-2;
  std::vector<double> gains(robot.size(), 1.0);
  gains[static_cast<std::size_t>(j)] = gain;
  return {true,
          "too_long",
          static_cast<std::size_t>(j),
          "",
          fmt::format("{} goes from {:.4g} to {:.4g} m, where the URDF's limits leave {:.3g} m: its q is in {}?",
                      of_joint(robot, j), lower, upper, range, gain < 5e-3 ? "mm" : "cm"),
          fmt::format("in [signals], times what stands there:\nposition_gain = [{}]", fmt::join(gains, ", "))};
}

}  // namespace

LogFacts facts_of(const Log& log, const LogFactOptions& options) {
  LogFacts facts;
  facts.name = log.file.filename().string();
  facts.role = log.role;
  facts.seconds = static_cast<double>(log.samples()) * log.step_s;
  facts.rate_hz = 1 / log.step_s;
  facts.resampled = log.resampled;
  facts.time_note = log.time_note;
  facts.q_lower = log.q.colwise().minCoeff().transpose().array() + 0.0;  // no "-0"
  facts.q_upper = log.q.colwise().maxCoeff().transpose().array() + 0.0;
  const Index short_window = window_of(log, options.speed_window_s), window = window_of(log, options.rest_window_s);
  facts.speed.resize(log.joints());
  for (Index j = 0; j < log.joints(); ++j) facts.speed[j] = coarse_speed(log, j, short_window).maxCoeff();
  facts.largest_torque =
      log.tau.size() > 0 ? VectorXd(log.tau.cwiseAbs().colwise().maxCoeff().transpose()) : VectorXd::Zero(log.joints());
  facts.encoder_step.resize(log.joints());
  for (Index j = 0; j < log.joints(); ++j)
    facts.encoder_step[j] = log.encoder_step.size() > 0 ? log.encoder_step[j] : encoder_step(log.q.col(j));

  // A joint rests where it moves by less than two steps of its encoder, or by next to nothing of its speed.
  const double window_s = static_cast<double>(window) * log.step_s;
  VectorXd rest = (options.rest_speed * facts.speed).cwiseMax(2.01 / window_s * facts.encoder_step);
  const Index rows = log.samples() - window;
  Eigen::Array<bool, Eigen::Dynamic, 1> resting = Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(rows, true);
  for (Index j = 0; j < log.joints(); ++j) {
    rest[j] = std::max(rest[j], options.noise_deviations * std::numbers::sqrt2 * noise_of(log.q.col(j)) / window_s);
    resting = resting && (coarse_speed(log, j, window).array() <= rest[j]);
  }
  Index first = 0, last = rows;
  while (first < rows && resting[first]) ++first;
  while (last > first && resting[last - 1]) --last;
  facts.rest_share = static_cast<double>(resting.count()) / static_cast<double>(std::max<Index>(1, rows));
  const bool moves = first < last;
  // Of the first window that is not at rest only its end has moved.
  const Index margin = window - short_window;
  facts.rest_until_s = moves ? log.t[first > 0 ? first + margin : 0] : log.t[0];
  facts.rest_from_s =
      moves ? log.t[last < rows ? last - 1 + short_window : log.samples() - 1] : log.t[log.samples() - 1];
  facts.begin_s = log.t[0];
  facts.end_s = log.t[log.samples() - 1];
  return facts;
}

std::vector<JointFacts> joints_of(const std::vector<LogFacts>& logs, const Robot& robot,
                                  const std::vector<ProcessedLog>& train) {
  std::vector<JointFacts> out;
  for (std::size_t j = 0; j < robot.size(); ++j) {
    const Joint& joint = robot.joints[j];
    const auto at = static_cast<Index>(j);
    JointFacts facts;
    facts.name = joint.name;
    facts.unit = joint.position_unit();
    facts.lower = INFINITY;
    facts.upper = -INFINITY;
    for (const LogFacts& log : logs) {
      facts.lower = std::min(facts.lower, log.q_lower[at]);
      facts.upper = std::max(facts.upper, log.q_upper[at]);
      facts.speed = std::max(facts.speed, log.speed[at]);
      facts.encoder_step = std::max(facts.encoder_step, log.encoder_step[at]);
      facts.largest_torque = std::max(facts.largest_torque, log.largest_torque[at]);
    }
    if (joint.limits && !joint.continuous && joint.limits->upper > joint.limits->lower)
      facts.range_share = (facts.upper - facts.lower) / (joint.limits->upper - joint.limits->lower);
    if (joint.limits && joint.limits->velocity > 0) facts.speed_share = facts.speed / joint.limits->velocity;
    Index saturated = 0, samples = 0;
    for (const ProcessedLog& log : train) {
      samples += log.samples();
      if (log.saturated.empty()) continue;
      for (const auto& [from, to] : log.saturated[j]) saturated += to - from;
    }
    facts.saturated_share = static_cast<double>(saturated) / static_cast<double>(std::max<Index>(1, samples));
    out.push_back(std::move(facts));
  }
  return out;
}

std::vector<CheckFinding> saturation_of(const std::vector<JointFacts>& joints, const LogFactOptions& options) {
  std::vector<CheckFinding> out;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].saturated_share < options.saturated) continue;
    out.push_back(
        {false, "saturated", j, "",
         fmt::format("torque of joint {} ({}) is at a limit for {:.0f} % of the train logs: that part is left "
                     "out; record with less load or speed",
                     j + 1, joints[j].name, 100 * joints[j].saturated_share),
         ""});
  }
  return out;
}

std::vector<CheckFinding> findings_of(const std::vector<LogFacts>& logs, const Robot& robot,
                                      const LogFactOptions& options) {
  std::vector<CheckFinding> out;
  const auto n = static_cast<Index>(robot.size());
  VectorXd lower = VectorXd::Constant(n, 1e300), upper = -lower, speed = VectorXd::Zero(n);
  for (const LogFacts& log : logs) {
    add_rest(log, options, log.begin_s, log.end_s, out);
    if (!log.time_note.empty()) out.push_back({false, "time_unit", {}, "", log.time_note, ""});
    lower = lower.cwiseMin(log.q_lower);
    upper = upper.cwiseMax(log.q_upper);
    speed = speed.cwiseMax(log.speed);
  }
  for (Index j = 0; j < n; ++j) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    const auto at = static_cast<std::size_t>(j);
    const std::string unit = joint.position_unit();
    if (!(upper[j] > lower[j])) {
      out.push_back({false, "never_moves", at, "",
                     fmt::format("{} never moves: nothing of it can be told", of_joint(robot, j)), ""});
      continue;
    }
    if (!joint.limits || joint.continuous) continue;
    const double range = joint.limits->upper - joint.limits->lower;
    const double beyond = std::max(upper[j] - joint.limits->upper, joint.limits->lower - lower[j]);
    if (joint.type == JointType::prismatic && range > 0 && upper[j] - lower[j] > options.impossible * range) {
      out.push_back(too_long(robot, j, lower[j], upper[j]));
      continue;
    }
    if (range > 0 && beyond > options.beyond * range) {
      out.push_back(
          {false, "beyond_limits", at, "",
           fmt::format("{} goes from {:.4g} to {:.4g} {}, up to {:.3g} beyond the URDF's limits {:.4g} to {:.4g}: "
                       "its zero, sign or unit, or another joint's column?",
                       of_joint(robot, j), lower[j], upper[j], unit, beyond, joint.limits->lower, joint.limits->upper),
           ""});
    } else if (joint.type == JointType::revolute && range > 0 && upper[j] - lower[j] < options.least_range * range &&
               range < options.widest) {
      out.push_back({false, "little_range", at, "",
                     fmt::format("{} covers {:.2g} {} of the {:.3g} that the URDF allows: what depends on its position "
                                 "can't be told",
                                 of_joint(robot, j), upper[j] - lower[j], unit, range),
                     ""});
    }
    if (joint.limits->velocity > 0 && speed[j] > options.too_fast * joint.limits->velocity) {
      out.push_back(
          {false, "too_fast", at, "",
           fmt::format("{} reaches {:.3g} {}/s, {:.2g} times the URDF's limit: the unit of q or t, or q on the "
                       "motor's side of the gearbox?",
                       of_joint(robot, j), speed[j], unit, speed[j] / joint.limits->velocity),
           ""});
    }
  }
  return out;
}

}  // namespace fxdyn
