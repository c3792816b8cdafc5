#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "host_tools/logs/log.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/readers/log_reader.hpp"
#include "host_tools/simulate/simulate.hpp"
#include "host_tools/support/files.hpp"
#include "tests/support/files.hpp"

namespace fxdyn::test {

using nlohmann::json;

/// Two sessions of an arm of two joints in a vertical plane.
struct Sessions {
  std::string missing{};  ///< effects of the session in question
  std::string already{};  ///< of both sessions
  std::string sensors{};
  double friction = 1;   ///< of the session in question, relative to the baseline
  double fore_mass = 3;  ///< [kg]
  bool baseline = true;
  bool validate = true;
  bool test = true;
  int max_effects = 3;
  double test_starts_s = 48;                   ///< a1, a2 begin at 0 and 12 s, b1 and b2 at 24 and 36
  std::function<void(Log&)> tamper = nullptr;  ///< with the logs of the session in question
};

/// As a scenario's text; `friction` scales what two sessions may differ by.
inline std::string arm(int seed, double friction, const std::string& sensors = {}) {
  std::string text = fmt::format(
      "seed = {}\n[sensors]\nencoder_bits = 19\ntorque_noise = 0.01\nar_noise = 0.003\n{}\n[robot]\nurdf = "
      "\"arm.urdf\"\nrated_torque = [60, 20]\nacceleration = [8, 12]\n",
      seed, sensors);
  const auto effect = [&](int joint, const char* name, const std::string& parameters) {
    text += fmt::format("[[effect]]\nname = \"{}\"\njoint = {}\nparameters = {{ {} }}\n", name, joint, parameters);
  };
  for (int joint = 1; joint <= 2; ++joint) {
    const double size = joint == 1 ? 1 : 0.4;
    effect(joint, "viscous", fmt::format("coefficient = {}", 1.5 * size * friction));
    effect(joint, "coulomb", fmt::format("amplitude = {}, width = 0.015", 2.0 * size * friction));
    effect(joint, "offset", fmt::format("torque = {}", 0.3 * size));
    effect(joint, "rotor_inertia", fmt::format("inertia = {}", 0.2 * size));
  }
  return text;
}

/// Fast and slow logs of 12 s, `first` on: seeds and the time at which they begin.
inline std::string recordings(const std::vector<std::string>& names, int first, double start_s = 0) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    text += fmt::format("[[log]]\nname = \"{}\"\nduration_s = 12\nperiod_s = 6\nspeed = {}\nseed = {}\nstart_s = {}\n",
                        names[i], i % 2 == 0 ? 0.8 : 0.12, first + static_cast<int>(i),
                        start_s + 12 * static_cast<double>(i));
  }
  return text;
}

inline std::filesystem::path diagnose_sessions(const std::string& name, const Sessions& c) {
  const std::filesystem::path folder = test::folder() / name;
  std::filesystem::create_directories(folder);
  write_file(folder / "arm.urdf", fmt::format(R"(<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.2 0.01 0"/><mass value="5"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.08" iyz="0" izz="0.08"/></inertial></link>
<link name="fore"><inertial><origin xyz="0.15 0 0.02"/><mass value="{0}"/><inertia ixx="{1}" ixy="0" ixz="0" iyy="{2}" iyz="0" izz="{2}"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="60"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="3" effort="20"/></joint>
</robot>
)",
                                              c.fore_mass, 0.002 * c.fore_mass, 0.05 / 3 * c.fore_mass));
  write_file(folder / "healthy.toml", arm(3, 1, c.sensors) + c.already + recordings({"h1", "h2"}, 100));
  const std::string today = arm(4, c.friction, c.sensors) + c.already + c.missing;
  write_file(folder / "now.toml", today + recordings({"a1", "a2", "b1", "b2"}, 200));
  write_file(folder / "later.toml", today + recordings({"c1", "c2"}, 204, c.test_starts_s));
  for (const char* scenario : {"healthy", "now", "later"}) {
    for (const auto& file : simulate(folder / fmt::format("{}.toml", scenario), folder)) {
      if (!c.tamper || scenario == std::string("healthy")) continue;
      Log log = read_log(file, 2, {true, true}, {}, {}, {});
      c.tamper(log);
      write_log(file, log);
    }
  }
  std::string project = "[robot]\nurdf = \"arm.urdf\"\nrated_torque = [60, 20]\n";
  const auto add = [&](bool wanted, const std::vector<const char*>& logs, const char* role) {
    for (const char* log : wanted ? logs : std::vector<const char*>{})
      project += fmt::format("[[log]]\nfile = \"{}.csv\"\nrole = \"{}\"\n", log, role);
  };
  add(c.baseline, {"h1", "h2"}, "baseline");
  add(true, {"a1", "a2"}, "train");
  add(c.validate, {"b1", "b2"}, "validate");
  add(c.test, {"c1", "c2"}, "test");
  project += fmt::format("[diagnose]\nmax_effects = {}\n", c.max_effects);
  write_file(folder / "project.toml", project);
  Pipeline(folder / "project.toml", folder / "out").diagnose();
  return folder / "out";
}

inline json diagnosed(const std::string& name, const Sessions& c) {
  return json::parse(read_file(diagnose_sessions(name, c) / "diagnosis.json"));
}

inline std::string effect(const std::string& name, int joint, const std::string& parameters) {
  return fmt::format("[[effect]]\nname = \"{}\"\n{}parameters = {{ {} }}\n", name,
                     joint > 0 ? fmt::format("joint = {}\n", joint) : "", parameters);
}

inline double parameter(const json& effect, const std::string& name) {
  for (const json& p : effect.at("parameters")) {
    if (p.at("name") == name) return p.at("value");
  }
  ADD_FAILURE() << "no parameter " << name;
  return 0;
}

/// The one effect that a joint is expected to have.
inline const json& only(const json& report, std::size_t joint, const std::string& name) {
  const json& effects = report.at("joints").at(joint).at("effects");
  EXPECT_EQ(effects.size(), 1U) << effects.dump(1);
  static const json none = json::object({{"parameters", json::array()}});
  if (effects.empty()) return none;
  EXPECT_EQ(effects[0].at("effect"), name);
  return effects[0];
}

}  // namespace fxdyn::test
