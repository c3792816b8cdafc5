#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/files.hpp"
#include "host_tools/pipeline/pipeline.hpp"
#include "host_tools/simulate/simulate.hpp"
#include "tests/support/files.hpp"
#include "tests/support/sanitizers.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

/// An arm of two joints with friction, as a scenario's text; `friction` scales what two sessions may differ by.
std::string arm(int seed, double friction, const std::string& sensors = {}) {
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
std::string recordings(const std::vector<std::string>& names, int first) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    text += fmt::format("[[log]]\nname = \"{}\"\nduration_s = 12\nperiod_s = 6\nspeed = {}\nseed = {}\nstart_s = {}\n",
                        names[i], i % 2 == 0 ? 0.8 : 0.12, first + static_cast<int>(i), 12 * i);
  }
  return text;
}

struct Case {
  std::string missing{};  ///< effects of the session in question
  std::string already{};  ///< of both sessions
  std::string sensors{};
  double friction = 1;  ///< of the session in question, relative to the baseline
  bool baseline = true;
};

json diagnosed(const std::string& name, const Case& c) {
  const fs::path folder = test::folder() / name;
  fs::create_directories(folder);
  write_file(folder / "arm.urdf", R"(<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.2 0.01 0"/><mass value="5"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.08" iyz="0" izz="0.08"/></inertial></link>
<link name="fore"><inertial><origin xyz="0.15 0 0.02"/><mass value="3"/><inertia ixx="0.006" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.05"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="2" effort="60"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="3" effort="20"/></joint>
</robot>
)");
  write_file(folder / "healthy.toml", arm(3, 1, c.sensors) + c.already + recordings({"h1", "h2"}, 100));
  write_file(folder / "now.toml", arm(4, c.friction, c.sensors) + c.already + c.missing +
                                      recordings({"a1", "a2", "b1", "b2", "c1", "c2"}, 200));
  std::string project = "[robot]\nurdf = \"arm.urdf\"\nrated_torque = [60, 20]\n";
  const auto add = [&](const char* scenario, const char* log, const char* role) {
    project += fmt::format("[[log]]\nscenario = \"{}.toml\"\nlog = \"{}\"\nrole = \"{}\"\n", scenario, log, role);
  };
  if (c.baseline) {
    add("healthy", "h1", "baseline");
    add("healthy", "h2", "baseline");
  }
  for (const char* log : {"a1", "a2"}) add("now", log, "train");
  for (const char* log : {"b1", "b2"}) add("now", log, "validate");
  for (const char* log : {"c1", "c2"}) add("now", log, "test");
  write_file(folder / "project.toml", project);
  Pipeline(folder / "project.toml", folder / "out").diagnose();
  return json::parse(read_file(folder / "out" / "diagnosis.json"));
}

std::string effect(const std::string& name, int joint, const std::string& parameters) {
  return fmt::format("[[effect]]\nname = \"{}\"\n{}parameters = {{ {} }}\n", name,
                     joint > 0 ? fmt::format("joint = {}\n", joint) : "", parameters);
}

double parameter(const json& effect, const std::string& name) {
  for (const json& p : effect.at("parameters")) {
    if (p.at("name") == name) return p.at("value");
  }
  ADD_FAILURE() << "no parameter " << name;
  return 0;
}

/// The one effect that a joint is expected to have.
const json& only(const json& report, std::size_t joint, const std::string& name) {
  const json& effects = report.at("joints").at(joint).at("effects");
  EXPECT_EQ(effects.size(), 1U) << effects.dump(1);
  static const json none = json::object({{"parameters", json::array()}});
  if (effects.empty()) return none;
  EXPECT_EQ(effects[0].at("effect"), name);
  return effects[0];
}

TEST(Diagnosis, NothingIsMissingWhereOnlyFrictionChangedALittle) {
  const json report = diagnosed("clean", {.friction = 1.05});
  EXPECT_EQ(report.at("verdict"), "nothing_missing") << report.dump(1);
  EXPECT_TRUE(report.at("robot_effects").empty());
}

TEST(Diagnosis, NamesWhatIsMissingWithItsParameters) {
  const json report = diagnosed("ripple", {.missing = effect("ripple", 2, "wavenumber = 31.0, cos = 0.15, sin = 0.1")});
  EXPECT_EQ(report.at("verdict"), "effects_found");
  const json& ripple = only(report, 1, "ripple");
  EXPECT_NEAR(parameter(ripple, "wavenumber"), 31, 0.3);
  EXPECT_NEAR(std::hypot(parameter(ripple, "cos"), parameter(ripple, "sin")), std::hypot(0.15, 0.1), 0.02);
  EXPECT_GT(ripple.at("held_out_closure"), 0.8);
  const json& joint = report.at("joints").at(1);
  EXPECT_LT(joint.at("gap_after"), joint.at("gap_before"));
  EXPECT_TRUE(report.at("joints").at(0).at("effects").empty());
}

TEST(Diagnosis, ALoadIsTheRobotsAndNotTheJoints) {
  const json report =
      diagnosed("payload", {.missing = effect("payload", 0, "mass = 0.4, com_x = 0.25, com_y = 0.0, com_z = 0.0")});
  ASSERT_EQ(report.at("robot_effects").size(), 1U) << report.dump(1);
  const json& payload = report.at("robot_effects").at(0);
  EXPECT_EQ(payload.at("effect"), "payload");
  EXPECT_NEAR(parameter(payload, "mass"), 0.4, 0.08);
  for (const json& joint : report.at("joints")) EXPECT_TRUE(joint.at("effects").empty());
}

TEST(Diagnosis, WithoutABaselineALoadIsNoFinding) {
  // Base parameters contain it: nothing can tell.
  const json report = diagnosed(
      "unidentifiable",
      {.missing = effect("payload", 0, "mass = 0.4, com_x = 0.25, com_y = 0.0, com_z = 0.0"), .baseline = false});
  EXPECT_EQ(report.at("verdict"), "nothing_missing") << report.dump(1);
  const json& blind = report.at("not_identifiable");
  EXPECT_NE(std::find(blind.begin(), blind.end(), "payload"), blind.end());
}

TEST(Diagnosis, WhatTheHealthyRobotHasAlreadyIsNoFinding) {
  const json report =
      diagnosed("background", {.already = effect("ripple", 1, "wavenumber = 12.0, cos = 0.6, sin = 0.2")});
  EXPECT_EQ(report.at("verdict"), "nothing_missing") << report.dump(1);
  EXPECT_FALSE(report.at("notes").empty());
}

TEST(Diagnosis, ALinkEncoderShowsWhatBends) {
  const json report = diagnosed("gear", {.missing = effect("elasticity", 2, "compliance = 1e-4, relaxation = 0.002"),
                                         .sensors = "link_encoders = \"all\"\nlink_encoder_bits = 19"});
  const json& gear = only(report, 1, "elasticity");
  EXPECT_NEAR(parameter(gear, "compliance"), 1e-4, 1e-5);
}

TEST(Diagnosis, DriftRunsOnThroughTheSession) {
  const json report = diagnosed(
      "drift", {.missing = effect("friction_drift", 1, "time_constant = 30.0, coulomb = -0.9, viscous = -0.5")});
  const json& drift = only(report, 0, "friction_drift");
  EXPECT_NEAR(parameter(drift, "coulomb"), -0.9, 0.3);
}

}  // namespace
}  // namespace fxdyn
