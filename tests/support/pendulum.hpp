#pragma once

#include <string>
#include <utility>
#include <vector>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/signals/fourier.hpp"
#include "host_tools/support/random.hpp"
#include "tests/support/filter.hpp"

namespace fxdyn::test {

/// A chain of equal links of 0.3 m and 2 kg that swing in a vertical plane.
inline Robot pendulum(std::size_t joints = 1) {
  Robot robot;
  robot.name = "pendulum";
  for (std::size_t j = 0; j < joints; ++j) {
    Joint joint;
    joint.name = "joint_" + std::to_string(j + 1);
    joint.link = "link_" + std::to_string(j + 1);
    joint.axis = Eigen::Vector3d::UnitY();
    if (j > 0) joint.origin.translation() = Eigen::Vector3d(0.3, 0, 0);
    joint.inertial = Inertial{2, {0.15, 0, 0}, 0.02 * Eigen::Matrix3d::Identity()};
    robot.joints.push_back(joint);
  }
  return robot;
}

inline EffectFit effect_fit(std::string name, std::vector<double> shape, std::vector<double> linear) {
  EffectFit fit;
  fit.effect = std::move(name);
  fit.shape = std::move(shape);
  fit.linear = std::move(linear);
  return fit;
}

/// The robot with its own inertias and, on every joint, these effects.
inline IdentifiedModel model_of(const Robot& robot, const std::vector<EffectFit>& effects = {}) {
  IdentifiedModel model;
  model.robot = robot;
  const DhChain chain = to_dh(robot);
  for (std::size_t j = 0; j < robot.size(); ++j) {
    model.inertia.push_back(to_link_inertia(*robot.joints[j].inertial, chain.urdf_in_dh[j]));
    JointFit joint;
    joint.sign_width = 0.05;
    joint.effects = effects;
    joint.rated_torque = joint.tau_limit = 20;
    joint.q_lower = -2;
    joint.q_upper = 2;
    joint.dq_limit = 3;
    joint.ddq_limit = 20;
    model.joints.push_back(joint);
  }
  return model;
}

/// The model's torque over a Fourier motion of every joint that the log knows exactly; 250 samples a second.
/// @param lead_s per joint: its torque column is so far ahead of the motion; empty: none is
inline Log exact_log(const IdentifiedModel& model, Role role, std::uint64_t seed, double duration_s = 20,
                     const std::vector<double>& lead_s = {}) {
  const auto samples = static_cast<Eigen::Index>(250 * duration_s);
  const auto n = static_cast<Eigen::Index>(model.robot.size());
  constexpr double period_s = 10;
  Log log;
  log.file = "log_" + std::to_string(seed) + ".csv";
  log.role = role;
  log.step_s = 0.004;
  log.to_s = duration_s;
  log.t = Eigen::VectorXd::LinSpaced(samples, 0, log.step_s * static_cast<double>(samples - 1));
  log.q.resize(samples, n);
  log.dq = log.ddq = log.q;
  std::vector<FourierJoint> series;
  for (Eigen::Index j = 0; j < n; ++j)
    series.push_back(random_fourier(100 * seed + static_cast<std::uint64_t>(j), 5, period_s, {-1.5, 1.5, 2, 12}, 1));
  const auto move = [&](double ahead_s) {
    for (Eigen::Index j = 0; j < n; ++j) {
      for (Eigen::Index k = 0; k < samples; ++k) {
        const FourierState state = evaluate(series[static_cast<std::size_t>(j)], period_s, log.t[k] + ahead_s);
        log.q(k, j) = state.q;
        log.dq(k, j) = state.dq;
        log.ddq(k, j) = state.ddq;
      }
    }
    return predict(model, log.q, log.dq, log.ddq, log.step_s);
  };
  log.tau.resize(samples, n);
  for (std::size_t j = 0; j < lead_s.size(); ++j) {
    const auto k = static_cast<Eigen::Index>(j);
    log.tau.col(k) = move(lead_s[j]).col(k);
  }
  const Eigen::MatrixXd tau = move(0);
  if (lead_s.empty()) log.tau = tau;
  return log;
}

inline void add_torque_noise(Log& log, double sigma, std::uint64_t seed) {
  Random random(seed);
  for (double& torque : log.tau.reshaped()) torque += sigma * random.normal();
}

/// The position as it is; torque and columns up to 12 Hz.
inline FilterFit small_filter(std::size_t joints) {
  FilterFit filter = filter_of(1000, 12, 0.3);
  filter.encoder_step = filter.position_noise = std::vector<double>(joints, 0.0);
  return filter;
}

inline std::vector<ProcessedLog> processed(std::vector<Log> logs) {
  std::vector<ProcessedLog> out;
  for (Log& log : logs) {
    const auto joints = static_cast<std::size_t>(log.joints());
    out.push_back(process(std::move(log), small_filter(joints)));
  }
  return out;
}

/// Designs without what the data have to tell: effects without coefficients.
inline std::vector<JointFit> design_of(const IdentifiedModel& model) {
  std::vector<JointFit> design = model.joints;
  for (JointFit& joint : design) {
    for (EffectFit& fit : joint.effects) fit.linear.clear();
  }
  return design;
}

}  // namespace fxdyn::test
