#include "host_tools/exchange/load_friction.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "host_tools/exchange/certificate.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "tests/support/files.hpp"
#include "tests/support/pendulum.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
namespace fs = std::filesystem;

/// One arm that swings in a vertical plane.
const char* const arm = R"(<robot name="arm"><link name="base"/><link name="link">
<inertial><origin xyz="0.2 0 0"/><mass value="3"/><inertia ixx="0.02" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial>
</link><joint name="joint" type="continuous"><parent link="base"/><child link="link"/><axis xyz="0 1 0"/></joint></robot>)";
constexpr double mass = 3, centre = 0.2, inertia = 0.05 + mass * centre * centre, gravity = 9.81;

struct Case {
  int model;
  GearFriction load;
};

/// Every number of each is another one than 0.
const std::vector<Case> every_model{{1, {}},
                                    {2, {}},
                                    {3, {3, 0.1, 0.1}},
                                    {4, {4, 0.1, 0.1, 0.2, 0.2}},
                                    {5, {5, 0.3, 0.1, 0.05, 0.2}},
                                    {6, {6, 0.2, 0.3, 0.1, 0.05, 0.004, 0.006}}};

SimpleJoint joint_of(const Case& one) {
  const bool stribeck = one.model != 1 && one.model != 3;
  return {0.2, 0.4, 0.03, 0, stribeck ? 0.3 : 0, stribeck ? 0.8 : 0, one.load};
}

class BamLoad : public testing::Test {
 protected:
  BamLoad() : urdf(test::write("arm.urdf", arm)), model(test::model_of(read_urdf(urdf))) {
    model.joints[0].sign_width = 0.01;
    motion = test::exact_log(model, Role::test, 4, 10);
  }
  void set_effects(double load, double stribeck) {
    std::vector<EffectFit>& effects = model.joints[0].effects;
    effects = {test::effect_fit("viscous", {}, {0.2}), test::effect_fit("coulomb", {}, {0.4}),
               test::effect_fit("load_friction", {}, {load})};
    if (stribeck > 0) effects.push_back(test::effect_fit("stribeck", {0.2}, {stribeck}));
    train = test::processed({test::exact_log(model, Role::train, 1)});
    held_out = test::processed({test::exact_log(model, Role::test, 2)});
  }
  SimpleRobot simple(SimpleJoint said) const { return {model.robot, {said}, urdf}; }
  SimpleRobot fitted() const {
    SimpleRobot out = simple_robot(model, model.robot, true, train, {}, true);
    out.urdf = urdf;
    fit_load_friction(out, model, train);
    return out;
  }
  fs::path file() const { return test::folder() / format.file; }

  const ExportFormat& format = export_format("bam");
  fs::path urdf;
  IdentifiedModel model;
  Log motion;
  std::vector<ProcessedLog> train, held_out;
};

/// frictionloss and damping of bam/model.py, from the keys of its file.
double friction(const nlohmann::json& p, double motor, double external, double dq) {
  const auto value = [&](const char* key) { return p.value(key, 0.0); };
  const double gear = std::fabs(external - motor);
  double bell = 0, out = p.at("friction_base");
  if (p.contains("alpha")) bell = std::exp(-std::pow(std::fabs(dq / value("dtheta_stribeck")), value("alpha")));
  out += bell * value("friction_stribeck") + value("friction_viscous") * std::fabs(dq);
  out += (value("load_friction_base") + bell * value("load_friction_stribeck")) * gear;
  out += std::fabs(external * value("load_friction_external") - motor * value("load_friction_motor"));
  out += bell *
         std::fabs(external * value("load_friction_external_stribeck") - motor * value("load_friction_motor_stribeck"));
  if ((external > 0) == (motor > 0)) return out;
  const bool drives = std::fabs(external) < std::fabs(motor);
  return out + bell * (drives ? value("load_friction_external_quad") * external * external
                              : value("load_friction_motor_quad") * motor * motor);
}

/// The motor's torque of one arm, by bisection.
double motor_torque(const nlohmann::json& p, double q, double dq, double ddq) {
  const double external = mass * gravity * centre * std::cos(q);
  const double wanted = (inertia + p.at("armature").get<double>()) * ddq - external;
  double low = -1000, high = 1000;
  for (int i = 0; i < 100; ++i) {
    const double m = 0.5 * (low + high);
    (m - wanted - (dq > 0 ? 1 : -1) * friction(p, m, external, dq) < 0 ? low : high) = m;
  }
  return low;
}

TEST_F(BamLoad, FileSaysWhatBamMakesOfIt) {
  for (const Case& one : every_model) {
    format.write(simple(joint_of(one)), file());
    const nlohmann::json p = nlohmann::json::parse(read_file(file())).at("joint");
    EXPECT_EQ(p.at("model"), fmt::format("m{}", one.model));
    const MotionRows rows{motion.q, motion.dq, motion.ddq};
    const MatrixXd replayed = format.replay(file(), model, rows, motion.step_s).tau;
    double off = 0, largest = 0;
    for (Index k = 0; k < replayed.rows(); ++k) {
      if (motion.dq(k, 0) == 0) continue;  // it sticks
      const double expected = motor_torque(p, motion.q(k, 0), motion.dq(k, 0), motion.ddq(k, 0));
      off = std::max(off, std::fabs(replayed(k, 0) - expected));
      largest = std::max(largest, std::fabs(expected));
    }
    EXPECT_LT(off, 1e-8 * largest) << one.model;
  }
}

/// Numbers of a joint's friction in the file.
std::vector<std::string> numbers_of(const nlohmann::json& joint) {
  std::vector<std::string> out;
  for (const auto& [key, value] : joint.items()) {
    if (value.is_number() && key != "alpha") out.push_back(key);
  }
  return out;
}

TEST_F(BamLoad, ErrorsInTheFileAreFound) {
  set_effects(0.15, 0.5);
  constexpr double degrees = 57.29577951308232, gear = 50;
  const std::vector<std::function<double(double)>> wrong{[](double x) { return -x; },
                                                         [](double x) { return x * degrees; },
                                                         [](double x) { return x / degrees; },
                                                         [](double x) { return x / gear; },
                                                         [](double x) { return x / (gear * gear); },
                                                         [](double) { return 0.0; }};
  for (const Case& one : every_model) {
    const SimpleRobot robot = simple(joint_of(one));
    format.write(robot, file());
    ASSERT_TRUE(certify(format, file(), robot, model, held_out).as_meant()) << one.model;
    const nlohmann::json right = nlohmann::json::parse(read_file(file()));
    const std::vector<std::string> keys = numbers_of(right.at("joint"));
    EXPECT_EQ(keys.size(), (std::array{3U, 5U, 4U, 7U, 9U, 11U}.at(static_cast<std::size_t>(one.model - 1))));
    for (const std::string& key : keys) {
      for (std::size_t k = 0; k < wrong.size(); ++k) {
        // an even power, or nothing to divide by
        if (key == "dtheta_stribeck" && (k == 0 || k == 5)) continue;
        nlohmann::json text = right;
        text["joint"][key] = wrong[k](text["joint"][key].get<double>());
        write_file(file(), text.dump(1));
        EXPECT_FALSE(certify(format, file(), robot, model, held_out).as_meant())
            << "m" << one.model << " " << key << " " << k;
      }
    }
  }
}

TEST_F(BamLoad, AModelsLoadFrictionIsWritten) {
  for (const double stribeck : {0.0, 0.5}) {
    set_effects(0.15, stribeck);
    SimpleRobot without = simple_robot(model, model.robot, true, train, {}, true);
    without.urdf = urdf;
    format.write(without, file());
    const JointCertificate lost = certify(format, file(), without, model, held_out).joints[0];
    const SimpleRobot robot = fitted();
    EXPECT_GE(robot.joints[0].load.model, stribeck > 0 ? 4 : 3);
    format.write(robot, file());
    const JointCertificate said = certify(format, file(), robot, model, held_out).joints[0];
    EXPECT_TRUE(said.as_meant);
    EXPECT_TRUE(said.left_out.empty());
    // What is left is the load that accelerating the arm makes, up to a third of gravity's: BAM's external torque has
    // none of it.
    EXPECT_LT(said.cannot_say, 0.8 * lost.cannot_say) << "m" << robot.joints[0].load.model;
    EXPECT_EQ(said.friction_model, fmt::format("m{}", robot.joints[0].load.model));
    EXPECT_EQ(lost.friction_model, stribeck > 0 ? "m2" : "m1");
    EXPECT_FALSE(lost.cannot_say_without_load_friction.has_value());
    // With the model's own load friction nothing would be lost but the turn of the sign, three of its widths away.
    ASSERT_TRUE(said.cannot_say_without_load_friction.has_value());
    EXPECT_LT(*said.cannot_say_without_load_friction, 0.05 * said.cannot_say_in_motion);
    EXPECT_LE(said.cannot_say_in_motion, said.cannot_say);
  }
}

TEST_F(BamLoad, NothingIsLostAtConstantSpeed) {
  set_effects(0.15, 0.5);
  const SimpleRobot robot = simple({0.2, 0.4, 0, 0, 0.5, 0.2, {5, 0, 0.15}});
  const MotionRows rows{motion.q, motion.dq, MatrixXd::Zero(motion.q.rows(), 1)};
  model.joints[0].sign_width = 1e-9;
  const MatrixXd off =
      torque_of(robot, model, rows, motion.step_s) - predict(model, rows.q, rows.dq, rows.ddq, motion.step_s);
  EXPECT_LT(off.cwiseAbs().maxCoeff(), 1e-9);
}

/// Gravity is the whole load of a motion that is slow enough: 0.3 rad/s^2 here.
Log slow_log(const IdentifiedModel& model) {
  Log log = test::exact_log(model, Role::train, 1, 25);
  for (Index k = 0; k < log.samples(); ++k) {
    const double t = log.t[k];
    log.q(k, 0) = 1.2 * std::sin(0.5 * t) + 0.2 * std::cos(0.3 * t);
    log.dq(k, 0) = 0.6 * std::cos(0.5 * t) - 0.06 * std::sin(0.3 * t);
    log.ddq(k, 0) = -0.3 * std::sin(0.5 * t) - 0.018 * std::cos(0.3 * t);
  }
  log.tau = predict(model, log.q, log.dq, log.ddq, log.step_s);
  return log;
}

TEST_F(BamLoad, TheModelsOwnCoefficientIsFound) {
  constexpr double lost = 0.15 * inertia * 0.32, fastest = 0.66;  // N*m that acceleration makes, rad/s
  for (const double stribeck : {0.0, 0.5}) {
    set_effects(0.15, stribeck);
    train = test::processed({slow_log(model)});
    const SimpleJoint said = fitted().joints[0];
    EXPECT_EQ(said.load.model, 5);
    EXPECT_NEAR(said.load.external, 0.15, 0.15 * 0.05);
    EXPECT_NEAR(said.load.motor, 0, 0.15 * 0.05);
    EXPECT_NEAR(said.friction, 0.4, 0.4 * 0.05);
    EXPECT_NEAR(said.damping, 0.2, lost / fastest);
    EXPECT_NEAR(said.stribeck, stribeck, 0.5 * 0.05);
  }
}

TEST_F(BamLoad, JointsWithoutItStayAsTheyAre) {
  set_effects(0, 0);
  model.joints[0].effects.pop_back();
  const SimpleRobot robot = fitted();
  EXPECT_EQ(robot.joints[0].load.model, 0);
  EXPECT_TRUE(robot.beside_load.empty());
}

TEST_F(BamLoad, SquaresTakeNoMoreOfATorqueThanOtherNumbersMay) {
  set_effects(0.4, 0.5);
  const LoadFrictionOptions any{.worth = 10};
  SimpleRobot robot = simple_robot(model, model.robot, true, train, {}, true);
  fit_load_friction(robot, model, train, {}, any);
  const GearFriction load = robot.joints[0].load;
  ASSERT_EQ(load.model, 6);
  const double largest = predict(model, train[0]).cwiseAbs().maxCoeff();
  EXPECT_GT(load.motor_quad + load.external_quad, 0);
  EXPECT_LE(load.motor_quad * largest, any.most * 1.000001);
  EXPECT_LE(load.external_quad * mass * gravity * centre, any.most * 1.01);  // the log may not reach the horizontal
}

/// A joint holds itself once friction takes all of the motor's torque: always, at low speed, and by its square.
TEST_F(BamLoad, SharesOfTheMotorsTorqueStayBelowAllOfIt) {
  set_effects(0.4, 0.5);
  Log fast = test::exact_log(model, Role::train, 1);
  fast.ddq *= 5;  // so that the motor's torque is far from the external one
  fast.tau = predict(model, fast.q, fast.dq, fast.ddq, fast.step_s);
  train = test::processed({fast});
  const double largest = predict(model, train[0]).cwiseAbs().maxCoeff();
  const auto sum_of = [&](double most) {
    SimpleRobot robot = simple_robot(model, model.robot, true, train, {}, true);
    fit_load_friction(robot, model, train, {}, {.worth = 10, .most = most});
    const GearFriction load = robot.joints[0].load;
    EXPECT_EQ(load.model, 6);
    return load.motor + load.motor_stribeck + load.motor_quad * largest;
  };
  EXPECT_LT(sum_of(LoadFrictionOptions{}.most), 1);
  // Bounded one by one, their sum would be 2.2 and 3 times as much as each may be.
  for (const double most : {0.1, 0.02}) EXPECT_NEAR(sum_of(most), 2 * most, 1e-6 * most);
}

TEST_F(BamLoad, TheCertificateNamesTheModelAndWhatTheLoadCosts) {
  set_effects(0.15, 0.5);
  const SimpleRobot robot = fitted();
  format.write(robot, file());
  const Certificate certificate = certify(format, file(), robot, model, held_out);
  const JointCertificate& joint = certificate.joints[0];
  const nlohmann::json json = to_json(certificate).at("joints")[0];
  EXPECT_EQ(json.at("friction_model"), joint.friction_model);
  EXPECT_EQ(json.at("cannot_say_without_load_friction").get<double>(), *joint.cannot_say_without_load_friction);
  EXPECT_EQ(json.at("cannot_say_in_motion").get<double>(), joint.cannot_say_in_motion);
  const std::string table = certificate_table(certificate);
  for (const std::string& word : {std::string("without load friction"), std::string("friction"), joint.friction_model,
                                  fmt::format("{:.4g}", *joint.cannot_say_without_load_friction)})
    EXPECT_NE(table.find(word), std::string::npos) << word << "\n" << table;
}

TEST_F(BamLoad, UnknownModelIsRefused) {
  format.write(simple({0.2, 0.4, 0.03, 0}), file());
  const std::string text = read_file(file());
  const MotionRows rows{motion.q, motion.dq, motion.ddq};
  for (const char* name : {"m0", "m7", "n3", "m12", ""}) {
    nlohmann::json other = nlohmann::json::parse(text);
    other["joint"]["model"] = name;
    write_file(file(), other.dump());
    EXPECT_THROW(format.replay(file(), model, rows, motion.step_s), DataError) << name;
  }
}

}  // namespace
}  // namespace fxdyn
