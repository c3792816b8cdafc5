#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>

#include "host_tools/exchange/certificate.hpp"
#include "host_tools/exchange/load_friction.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "tests/simulate/support.hpp"
#include "tests/support/files.hpp"
#include "tests/support/pendulum.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

/// Two joints. One has a drive of its own in the URDF; an effort of 0 would switch off what is written of the other.
const char* const driven_arm = R"(<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="4"/><inertia ixx="0.02" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="fore"><inertial><origin xyz="0.15 0 0"/><mass value="2"/><inertia ixx="0.01" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="0" velocity="2"/></joint>
<transmission name="own"><type>transmission_interface/SimpleTransmission</type><joint name="shoulder"/><actuator name="m1">
<drake:rotor_inertia value="99"/></actuator></transmission></robot>)";

class Drake : public testing::Test {
 protected:
  static constexpr double viscous = 0.8, dry = 1.5, rotor = 0.12, width = 0.01;

  Drake() : urdf(test::write("driven_arm.urdf", driven_arm)), model(test::model_of(read_urdf(urdf))) {
    for (JointFit& joint : model.joints) {
      joint.sign_width = width;
      joint.effects = {test::effect_fit("viscous", {}, {viscous}), test::effect_fit("coulomb", {}, {dry}),
                       test::effect_fit("rotor_inertia", {}, {rotor})};
    }
    train = test::processed({test::exact_log(model, Role::train, 1)});
    held_out = test::processed({test::exact_log(model, Role::test, 2)});
  }
  SimpleRobot simple() const {
    SimpleRobot out = simple_robot(model, model.robot, true, train, {.dry_friction = false});
    out.urdf = urdf;
    return out;
  }
  fs::path file() const { return test::folder() / format.file; }
  Certificate written(const SimpleRobot& robot) const {
    format.write(robot, file());
    return certify(format, file(), robot, model, held_out);
  }

  const ExportFormat& format = export_format("drake");
  fs::path urdf;
  IdentifiedModel model;
  std::vector<ProcessedLog> train, held_out;
};

TEST_F(Drake, FileSaysWhatWasMeant) {
  const Certificate certificate = written(simple());
  EXPECT_NO_THROW(require_as_meant(certificate));
  for (const JointCertificate& joint : certificate.joints) {
    EXPECT_EQ(joint.written->armature, rotor);
    EXPECT_EQ(joint.written->friction, 0);
    EXPECT_EQ(joint.left_out, std::vector<std::string>{"coulomb"});
    EXPECT_EQ(joint.sliding_share, 1);
  }
}

TEST_F(Drake, LossIsThatOfDryFriction) {
  const SimpleRobot robot = simple();
  const Certificate certificate = written(robot);
  for (Eigen::Index j = 0; j < 2; ++j) {
    const auto rest = [&](const ProcessedLog& log) -> Eigen::ArrayXd {
      const Eigen::ArrayXd dq = log.joint_velocity(j);
      return viscous * dq + dry * (dq / width).tanh();
    };
    const ProcessedLog &from = train[0], &over = held_out[0];
    const Eigen::Index count = from.last - from.first;
    const Eigen::ArrayXd fast = from.joint_velocity(j).segment(from.first, count),
                         used = (fast.abs() > 3 * width).cast<double>() * fast;
    const double damping = (used * rest(from).segment(from.first, count)).sum() / used.square().sum();
    const JointCertificate& joint = certificate.joints[static_cast<std::size_t>(j)];
    EXPECT_NEAR(joint.written->damping, damping, 1e-6 * damping);
    const Eigen::MatrixXd lost = rest(over) - damping * over.joint_velocity(j).array();
    const double expected = test::rms(over.filter_columns(lost).middleRows(over.first, over.last - over.first));
    EXPECT_GT(expected, 0.3);
    EXPECT_NEAR(joint.cannot_say, expected, 0.01 * expected);
  }
}

TEST_F(Drake, TheFilesOwnDrivesAreReplaced) {
  format.write(simple(), file());
  const std::string text = read_file(file());
  const auto count = [&](const std::string& word) {
    std::size_t out = 0;
    for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++out;
    return out;
  };
  EXPECT_EQ(count("<transmission "), 2U);
  EXPECT_EQ(count("\"99\""), 0U);
  EXPECT_EQ(count("effort=\"0\""), 0U);  // Drake would leave out the joint's drive, and its rotor
  SimpleRobot robot = simple();
  robot.joints[1].effort = 20;
  format.write(robot, file());
  EXPECT_NE(read_file(file()).find("effort=\"20\""), std::string::npos);
}

TEST_F(Drake, ErrorsInTheFileAreFound) {
  constexpr double degrees = 57.29577951308232, ratio = 50;
  const std::string of_elbow = "<joint name=\"elbow\"", actuator = "<actuator name=\"elbow\"";
  std::vector<std::pair<std::vector<std::string>, std::function<double(double)>>> errors;
  for (const auto& place : {std::vector<std::string>{of_elbow, "damping=\""}, {actuator, "rotor_inertia value=\""}}) {
    errors.emplace_back(place, [](double x) { return -x; });
    errors.emplace_back(place, [](double x) { return x * degrees; });
    errors.emplace_back(place, [](double x) { return x / degrees; });
    errors.emplace_back(place, [](double x) { return x / (ratio * ratio); });
    errors.emplace_back(place, [](double) { return 0.0; });
  }
  errors.emplace_back(std::vector<std::string>{actuator, "gear_ratio value=\""}, [](double) { return ratio; });
  errors.emplace_back(std::vector<std::string>{of_elbow, "effort=\""}, [](double) { return 0.0; });
  SimpleRobot robot = simple();
  robot.joints[1].effort = 20;
  for (const auto& [place, how] : errors) {
    EXPECT_TRUE(written(robot).as_meant());
    std::string text = read_file(file());
    std::size_t from = 0;
    for (const std::string& word : place) {
      from = text.find(word, from);
      ASSERT_NE(from, std::string::npos) << word;
      from += word.size();
    }
    const std::size_t to = text.find('"', from);
    text.replace(from, to - from, fmt::format("{:.17g}", how(std::stod(text.substr(from, to - from)))));
    write_file(file(), text);
    const Certificate wrong = certify(format, file(), robot, model, held_out);
    EXPECT_TRUE(wrong.joints[0].as_meant) << place.back();
    EXPECT_FALSE(wrong.joints[1].as_meant) << place.back();
  }
}

TEST_F(Drake, AnotherRobotOrNoXmlIsRefused) {
  const MotionRows motion = held_out[0].motion();
  EXPECT_THROW(format.replay(test::write("none.urdf", "no XML"), model, motion, 0.002), InputError);
  std::string text = driven_arm;
  text.replace(text.find("joint name=\"elbow\""), 18, "joint name=\"wrist\"");
  EXPECT_THROW(format.replay(test::write("other.urdf", text), model, motion, 0.002), DataError);
}

}  // namespace
}  // namespace fxdyn
