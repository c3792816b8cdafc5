#pragma once

#include <string>
#include <vector>

#include "host_tools/readers/log_reader.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/simulate/simulate.hpp"
#include "tests/support/files.hpp"
#include "tests/support/filter.hpp"

namespace fxdyn::test {

/// Two links in a vertical plane, friction on both joints, Stribeck on the first.
struct Arm {
  static constexpr double rated[] = {40, 15};

  /// Files of this test are named after it.
  explicit Arm(const std::string& name) : name_(name) {
    const auto link = [](const char* of, double mass, double length) {
      return std::string("<link name=\"") + of + "\"><inertial><origin xyz=\"" + std::to_string(length / 2) +
             " 0 0\"/><mass value=\"" + std::to_string(mass) +
             "\"/><inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.08\" iyz=\"0\" izz=\"0.08\"/></inertial></link>";
    };
    const auto joint = [](const char* of, const char* parent, const char* child, const char* xyz) {
      return std::string("<joint name=\"") + of + "\" type=\"revolute\"><parent link=\"" + parent +
             "\"/><child link=\"" + child + "\"/><origin xyz=\"" + xyz +
             "\"/><axis xyz=\"0 1 0\"/><limit lower=\"-2\" upper=\"2\" velocity=\"2\" effort=\"60\"/></joint>";
    };
    urdf = write(name + ".urdf", "<robot name=\"arm\"><link name=\"base\"/>" + link("upper", 5, 0.4) +
                                     link("fore", 3, 0.4) + joint("shoulder", "base", "upper", "0 0 0.5") +
                                     joint("elbow", "upper", "fore", "0.4 0 0") + "</robot>");
    const std::string friction[] = {"amplitude = 1.5", "amplitude = 0.8"};
    std::string text = "seed = 4\n[sensors]\nencoder_bits = 22\ntorque_noise = 0.002\n[robot]\nurdf = \"" + name +
                       ".urdf\"\nrated_torque = [40, 15]\nacceleration = [8, 8]\n";
    for (int j = 1; j <= 2; ++j) {
      const std::string on = "joint = " + std::to_string(j) + "\n";
      text += "[[effect]]\nname = \"viscous\"\n" + on + "parameters = { coefficient = 1.0 }\n";
      text += "[[effect]]\nname = \"coulomb\"\n" + on + "parameters = { " + friction[j - 1] + ", width = 0.02 }\n";
    }
    text += "[[effect]]\nname = \"stribeck\"\njoint = 1\nparameters = { velocity = 0.15, amplitude = 2.5 }\n";
    for (const char* log : {"a", "b"})
      text += std::string("[[log]]\nname = \"") + log +
              "\"\nduration_s = 8\nperiod_s = 8\nspeed = 0.3\nseed = " + std::to_string(log[0]) + "\n";
    scenario = write(name + ".toml", text);
    directory = folder() / name;
    logs = simulate(scenario, directory);
  }

  /// The plant, with limits that hold the log's motion.
  IdentifiedModel truth(const ProcessedLog& log) const {
    IdentifiedModel model = read_model(directory / "truth.json");
    const MotionRows motion = log.motion();
    for (std::size_t j = 0; j < 2; ++j) {
      const auto k = static_cast<Eigen::Index>(j);
      JointFit& joint = model.joints[j];
      joint.rated_torque = joint.tau_limit = rated[j];
      joint.q_lower = -3;
      joint.q_upper = 3;
      joint.dq_limit = 1.5 * motion.dq.col(k).cwiseAbs().maxCoeff();
      joint.ddq_limit = 1.5 * motion.ddq.col(k).cwiseAbs().maxCoeff();
    }
    return model;
  }

  ProcessedLog log(std::size_t i, Role role = Role::test) const {
    Log log = read_log(logs[i], 2, {true, true}, {}, {}, {});
    log.role = role;
    return process(std::move(log), filter_of(30, 20, 0.3));
  }

  std::filesystem::path urdf, scenario, directory;
  std::vector<std::filesystem::path> logs;

 private:
  std::string name_;
};

inline IdentifiedModel without(IdentifiedModel model, const std::string& effect) {
  for (JointFit& joint : model.joints)
    std::erase_if(joint.effects, [&](const EffectFit& fit) { return fit.effect == effect; });
  return model;
}

}  // namespace fxdyn::test
