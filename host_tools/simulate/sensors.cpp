#include "host_tools/simulate/sensors.hpp"

#include <cmath>
#include <numbers>

#include "host_tools/simulate/scenario.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;

/// Each kind of chance has a sequence of its own: to add one leaves the others as they were.
Random chance(const Scenario& scenario, const ScenarioLog& log, std::uint64_t kind) {
  return Random((scenario.seed * 7919 + log.seed) ^ (kind << 32));
}

/// Cubic through values and slopes at both ends of a step.
double cubic(double from, double slope_from, double to, double slope_to, double step, double share) {
  const double rest = 1 - share;
  return rest * rest * ((1 + 2 * share) * from + share * step * slope_from) +
         share * share * ((1 + 2 * rest) * to - rest * step * slope_to);
}

/// Every joint of every log begins in another phase.
void add_vibration(const TorqueVibration& vibration, double rated, double phase, const Eigen::VectorXd& t,
                   Eigen::Ref<Eigen::VectorXd> tau) {
  const double w = 2 * std::numbers::pi * vibration.frequency_hz;
  tau.array() += vibration.amplitude * rated * (w * (t.array() - t[0]) + phase).sin();
}

}  // namespace

Eigen::VectorXd sampling_times(const Scenario& scenario, const ScenarioLog& log) {
  const auto samples = static_cast<Index>(std::llround(log.duration_s / scenario.sample_s));
  Eigen::VectorXd t = Eigen::VectorXd::LinSpaced(samples, 0, scenario.sample_s * static_cast<double>(samples - 1));
  if (scenario.jitter == 0) return t;
  Random random = chance(scenario, log, 1);
  const double most = 0.5 * scenario.jitter * scenario.sample_s;
  for (double& instant : t) instant += random.uniform(-most, most);
  t[0] = std::fabs(t[0]);  // the run starts with the log
  return t;
}

Log sampled(const Scenario& scenario, const PlantRun& run, const Eigen::VectorXd& times) {
  const Index samples = times.size(), joints = run.q.cols(), last = run.q.rows() - 1;
  const bool deflects = !scenario.link_encoder.empty();
  Log log;
  log.t = times;
  for (Eigen::MatrixXd* signal : {&log.q, &log.tau}) signal->resize(samples, joints);
  if (scenario.exact_motion) {
    for (Eigen::MatrixXd* signal : {&log.dq, &log.ddq}) signal->resize(samples, joints);
  }
  if (deflects) log.qlink.resize(samples, joints);
  for (Index k = 0; k < samples; ++k) {
    const double at = times[k] / run.step_s;
    const double nearest = std::round(at);
    const bool on_grid = std::fabs(at - nearest) < 1e-6;
    const Index from = std::min(static_cast<Index>(on_grid ? nearest : std::floor(at)), last);
    const Index to = std::min(from + 1, last);
    const double share = on_grid ? 0 : at - static_cast<double>(from);
    const auto linear = [&](const Eigen::MatrixXd& x, Index j) {
      return on_grid ? x(from, j) : (1 - share) * x(from, j) + share * x(to, j);
    };
    const auto smooth = [&](const Eigen::MatrixXd& x, const Eigen::MatrixXd& slope, Index j) {
      return on_grid ? x(from, j) : cubic(x(from, j), slope(from, j), x(to, j), slope(to, j), run.step_s, share);
    };
    for (Index j = 0; j < joints; ++j) {
      log.q(k, j) = smooth(run.q, run.dq, j);
      log.tau(k, j) = linear(run.tau, j);
      if (scenario.exact_motion) {
        log.dq(k, j) = smooth(run.dq, run.ddq, j);
        log.ddq(k, j) = linear(run.ddq, j);
      }
      if (deflects) log.qlink(k, j) = log.q(k, j) - linear(run.deflections, j);
    }
  }
  return log;
}

void measure(const Scenario& scenario, const ScenarioLog& spec, Log& log) {
  Random white = chance(scenario, spec, 0), coloured = chance(scenario, spec, 2), phases = chance(scenario, spec, 3);
  for (Index j = 0; j < log.q.cols(); ++j) {
    const auto& joint = scenario.plant.robot.joints[static_cast<std::size_t>(j)];
    const auto encode = [&](auto&& column, int bits) {
      if (bits == 0) return;
      const double unit = joint.type == JointType::revolute ? 2 * std::numbers::pi : 1.0;
      const double step = unit / std::ldexp(1.0, bits);
      column = ((column / step).array().round() * step).matrix().eval();
    };
    encode(log.q.col(j), scenario.encoder_bits);
    if (!scenario.link_encoder.empty()) {
      encode(log.qlink.col(j), scenario.link_encoder_bits);
      if (!scenario.link_encoder[static_cast<std::size_t>(j)]) log.qlink.col(j).setConstant(std::nan(""));
    }
    const double rated = scenario.plant.joints[static_cast<std::size_t>(j)].rated_torque;
    const double sigma = scenario.torque_noise * rated;
    for (Index k = 0; k < log.samples(); ++k) log.tau(k, j) += sigma * white.normal();
    if (scenario.vibration.amplitude > 0)
      add_vibration(scenario.vibration, rated, phases.uniform(0, 2 * std::numbers::pi), log.t, log.tau.col(j));
    if (scenario.ar_noise == 0) continue;
    // e <- pole e + sqrt(1 - pole^2) rms n keeps the RMS that it starts with
    const double rms = scenario.ar_noise * rated, pole = scenario.ar_pole;
    double error = rms * coloured.normal();
    for (Index k = 0; k < log.samples(); ++k) {
      log.tau(k, j) += error;
      error = pole * error + std::sqrt(1 - pole * pole) * rms * coloured.normal();
    }
  }
}

}  // namespace fxdyn
