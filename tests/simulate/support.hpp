#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/signals/fourier.hpp"
#include "host_tools/simulate/closed_loop.hpp"
#include "tests/support/chains.hpp"
#include "tests/support/files.hpp"

namespace fxdyn::test {

/// A robot with its URDF's inertias and no effects.
inline IdentifiedModel plant_of(const Robot& robot) {
  IdentifiedModel plant;
  plant.robot = robot;
  const DhChain chain = to_dh(robot);
  plant.joints.resize(robot.size());
  for (std::size_t j = 0; j < robot.size(); ++j)
    plant.inertia.push_back(to_link_inertia(*robot.joints[j].inertial, chain.urdf_in_dh[j]));
  return plant;
}

inline bool slides(const Robot& robot) {
  return std::any_of(robot.joints.begin(), robot.joints.end(),
                     [](const Joint& joint) { return joint.type == JointType::prismatic; });
}

inline EffectFit effect(std::string name, std::vector<double> shape, std::vector<double> linear) {
  EffectFit fit;
  fit.effect = std::move(name);
  fit.shape = std::move(shape);
  fit.linear = std::move(linear);
  return fit;
}

/// The PUMA 560's published rotors and friction (host_tools/demo/scenario.toml).
inline IdentifiedModel puma_with_friction() {
  IdentifiedModel plant = plant_of(read_urdf(puma560));
  const std::array rotor{1.14, 4.71, 0.827, 0.2, 0.179, 0.193}, viscous{5.8, 9.5, 4.0, 0.41, 0.43, 0.22},
      coulomb{7.0, 10.6, 6.3, 1.07, 0.85, 0.7};
  for (std::size_t j = 0; j < 6; ++j) {
    plant.joints[j].sign_width = 0.002;
    plant.joints[j].effects = {effect("rotor_inertia", {}, {rotor[j]}), effect("viscous", {}, {viscous[j]}),
                               effect("coulomb", {}, {coulomb[j]})};
  }
  return plant;
}

/// Fourier motion of every joint, within +-1.5 rad or 0.5 m, 1.5 /s, 6 /s^2.
inline Reference motion_of(const Robot& robot, double step_s, double duration_s, double period_s = 5,
                           std::uint64_t seed = 3) {
  const auto samples = static_cast<Eigen::Index>(std::llround(duration_s / step_s));
  const auto n = static_cast<Eigen::Index>(robot.size());
  Reference motion{step_s, Eigen::MatrixXd(samples, n), Eigen::MatrixXd(samples, n), Eigen::MatrixXd(samples, n), {}};
  for (Eigen::Index j = 0; j < n; ++j) {
    const bool turns = robot.joints[static_cast<std::size_t>(j)].type == JointType::revolute;
    const double range = turns ? 1.5 : 0.5;
    const FourierJoint joint =
        random_fourier(seed + static_cast<std::uint64_t>(j), 5, period_s, {-range, range, 1.5, 6}, 1);
    for (Eigen::Index k = 0; k < samples; ++k) {
      const FourierState state = evaluate(joint, period_s, step_s * static_cast<double>(k));
      motion.q(k, j) = state.q;
      motion.dq(k, j) = state.dq;
      motion.ddq(k, j) = state.ddq;
    }
  }
  return motion;
}

inline double rms(const Eigen::Ref<const Eigen::MatrixXd>& x) {
  return std::sqrt(x.squaredNorm() / static_cast<double>(x.size()));
}

/// Head of a scenario of the PUMA 560.
inline std::string puma_scenario(const std::string& top, const std::string& sensors) {
  return "seed = 4\n" + top + "\n[sensors]\n" + sensors + "\n[robot]\nurdf = \"" + puma560.string() +
         "\"\nrated_torque = [97.6, 186.4, 89.4, 24.2, 20.1, 21.3]\nacceleration = [4, 4, 6, 12, 12, 12]\n";
}

inline std::string effect_text(std::size_t joint, const std::string& name, const std::string& parameters) {
  return fmt::format("[[effect]]\nname = \"{}\"\njoint = {}\nparameters = {{ {} }}\n", name, joint, parameters);
}

}  // namespace fxdyn::test
