#pragma once

#include <vector>

#include "host_tools/diagnose/linearised.hpp"
#include "host_tools/diagnose/models.hpp"
#include "host_tools/effects/link_parameters.hpp"
#include "tests/diagnose/small_log.hpp"

namespace fxdyn::test {

/// A PUMA 560, or the first of its joints, as an identification gives it: base parameters, and a little friction.
inline IdentifiedModel fitted_puma(std::size_t joints = 6) {
  Robot robot = read_urdf(puma560);
  robot.joints.resize(joints);
  IdentifiedModel model = plant_of(robot);
  const BaseSet base = find_base(to_dh(model.robot));
  Eigen::VectorXd standard(base.grouping.cols());
  for (std::size_t i = 0; i < model.inertia.size(); ++i) {
    const auto values = to_array(model.inertia[i]);
    for (std::size_t p = 0; p < values.size(); ++p)
      standard[static_cast<Eigen::Index>(i * parameters_per_link + p)] = values[p];
    model.inertia[i] = to_inertia(decltype(to_array(model.inertia[i])){});
  }
  const Eigen::VectorXd beta = base.grouping * standard;
  for (std::size_t k = 0; k < base.columns.size(); ++k) {
    BaseParameter parameter;
    parameter.column = static_cast<std::size_t>(base.columns[k]);
    model.base.push_back(parameter);
    diagnosis::add_to_base(model, k, beta[static_cast<Eigen::Index>(k)]);
  }
  for (JointFit& joint : model.joints) {
    joint.sign_width = 0.02;
    joint.rated_torque = joint.tau_limit = 100;
    joint.dq_limit = 3;
    joint.ddq_limit = 10;
    joint.q_lower = -3;
    joint.q_upper = 3;
    joint.effects = {effect("viscous", {}, {1}), effect("coulomb", {}, {2}), effect("offset", {}, {0.3})};
  }
  model.filter.encoder_step = model.filter.position_noise = std::vector<double>(model.joints.size(), 0.0);
  return model;
}

/// A log of a robot with that model: some 480 rows with white noise.
inline diagnosis::SessionLog small_session_log(const IdentifiedModel& robot, Role role, std::uint64_t seed) {
  diagnosis::SessionLog out;
  out.log = small_log(robot, role, seed, 0.25);
  out.log.filter.encoder_step = out.log.filter.position_noise = std::vector<double>(robot.joints.size(), 0.0);
  out.log.torque_noise = Eigen::VectorXd::Constant(out.log.tau.cols(), 0.03);  // 0.1 N*m white, up to 10 of 125 Hz
  out.log.decimation = 10;
  out.healthy = role == Role::baseline;
  out.fits = role != Role::validate;
  return out;
}

/// Models without a baseline.
inline diagnosis::Models around(const IdentifiedModel& model) {
  diagnosis::Models models;
  models.current = model;
  models.smallest_step_s = small_log_step_s;
  return models;
}

inline EffectFit named_effect(std::string name, std::vector<double> shape, std::vector<double> linear) {
  EffectFit fit = effect(std::move(name), std::move(shape), std::move(linear));
  fit.named = true;
  return fit;
}

/// White: the noise of small_log() is.
inline std::vector<Eigen::VectorXd> no_whitening(std::size_t joints = 6) {
  return std::vector<Eigen::VectorXd>(joints, Eigen::VectorXd::Zero(1));
}

}  // namespace fxdyn::test
