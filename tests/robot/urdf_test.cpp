#include <gtest/gtest.h>

#include <fstream>
#include <numbers>

#include "host_tools/support/error.hpp"
#include "tests/support/chains.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

std::filesystem::path write(const std::string& text) {
  const auto* info = testing::UnitTest::GetInstance()->current_test_info();
  auto file = test::folder() / (std::string(info->name()) + ".urdf");
  std::ofstream(file) << text;
  return file;
}

/// Two links on one moving joint; `joint` is the inside of the joint element.
std::string one_joint(const std::string& type, const std::string& joint, const std::string& link = "") {
  return "<robot name=\"r\">\n<link name=\"base\"/>\n<link name=\"tip\">" + link +
         "</link>\n<joint name=\"lift\" type=\"" + type + "\">\n<parent link=\"base\"/><child link=\"tip\"/>" + joint +
         "</joint>\n</robot>\n";
}

struct Bad {
  std::string name, text;
  std::vector<std::string> message;  ///< parts of it
};

class BadUrdf : public testing::TestWithParam<Bad> {};

TEST_P(BadUrdf, IsRefusedInOneLine) {
  const auto file = test::folder() / ("bad_" + GetParam().name + ".urdf");
  std::ofstream(file) << GetParam().text;
  testing::internal::CaptureStderr();
  std::string message;
  try {
    read_urdf(file);
  } catch (const InputError& error) {
    message = error.what();
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_NE(message.find(file.string()), std::string::npos) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  for (const std::string& part : GetParam().message) EXPECT_NE(message.find(part), std::string::npos) << message;
}

const std::string limit = "<limit lower=\"-1\" upper=\"1\" velocity=\"1\" effort=\"1\"/>";
const std::string z = "<axis xyz=\"0 0 1\"/>";

INSTANTIATE_TEST_SUITE_P(
    Table, BadUrdf,
    testing::Values(
        Bad{"malformed",
            "<robot name=\"r\">\n<link name=\"base\"/>\n<link name=\"tip\">\n</robot>\n",
            {":4: malformed XML"}},
        Bad{"empty", "", {"malformed XML"}}, Bad{"not_xml", "t,q1,tau1\n0,0,0\n", {".urdf"}},
        Bad{"other_root", "<sdf version=\"1.6\"></sdf>", {"no <robot> element"}},
        Bad{"no_links", "<robot name=\"r\"></robot>", {"not a valid URDF"}},
        Bad{"only_fixed", one_joint("fixed", ""), {"no moving joint"}},
        Bad{"missing_parent",
            "<robot name=\"r\"><link name=\"base\"/><joint name=\"lift\" type=\"continuous\"><parent "
            "link=\"bass\"/><child "
            "link=\"base\"/></joint></robot>",
            {"not a valid URDF"}},
        Bad{"zero_axis", one_joint("continuous", "<axis xyz=\"0 0 0\"/>"), {":4: joint 'lift'", "axis has no length"}},
        Bad{"bad_axis", one_joint("continuous", "<axis xyz=\"0 0 up\"/>"), {"lift"}},
        Bad{"no_limit", one_joint("revolute", z), {":4: joint 'lift'", "has no <limit>", "make it continuous"}},
        Bad{"bad_limit",
            one_joint("revolute", z + "<limit lower=\"low\" upper=\"1\"/>"),
            {":5: joint 'lift'", "is no number"}},
        Bad{"xacro", one_joint("continuous", z + "\n<origin xyz=\"${length} 0 0\"/>"), {":6:", "is a xacro file"}},
        Bad{"xacro_element", "<robot name=\"r\">\n<xacro:arm/></robot>", {":2:", "is a xacro file"}},
        Bad{"srdf", "<robot name=\"r\">\n<group name=\"arm\"/></robot>", {":2:", "is an SRDF", "URDF"}},
        Bad{"sdf", "<sdf version=\"1.6\"></sdf>", {"SDF"}}, Bad{"mjcf", "<mujoco/>", {"MJCF"}},
        Bad{"millimetres",
            "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><link name=\"c\"/>\n"
            "<joint name=\"j1\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/>"
            "<origin xyz=\"500 0 0\"/></joint>\n"
            "<joint name=\"j2\" type=\"continuous\"><parent link=\"b\"/><child link=\"c\"/>\n"
            "<origin xyz=\"0 250 0\"/></joint></robot>",
            {":4: joint 'j2'", "250 m", "millimetres?"}},
        Bad{"degrees", one_joint("continuous", z + "<origin rpy=\"0 90 0\"/>"), {":5: joint 'lift'", "degrees?"}},
        Bad{"kg_mm2",
            one_joint("continuous", z,
                      "<inertial><mass value=\"2\"/><inertia ixx=\"9e4\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" "
                      "iyz=\"0\"/></inertial>"),
            {":3: link 'tip'", "kg mm^2?", "divide by 1e6"}},
        Bad{"grams",
            one_joint("continuous", z,
                      "<inertial><mass value=\"25000\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" "
                      "iyz=\"0\"/></inertial>"),
            {":3: link 'tip'", "grams?"}},
        Bad{"floating", one_joint("floating", z), {":4: joint 'lift'", "not supported"}},
        Bad{"planar", one_joint("planar", z), {":4: joint 'lift'", "not supported"}},
        Bad{"unknown_type", one_joint("screw", z), {"lift"}},
        Bad{"mimic", one_joint("revolute", z + limit + "<mimic joint=\"lift\"/>"), {":4: joint 'lift'", "mimic"}},
        Bad{"negative_mass",
            one_joint("continuous", z,
                      "<inertial><mass value=\"-1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" "
                      "iyz=\"0\"/></inertial>"),
            {":3: link 'tip'", "mass is not positive"}},
        Bad{"negative_inertia",
            one_joint("continuous", z,
                      "<inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"-1\" ixy=\"0\" ixz=\"0\" "
                      "iyz=\"0\"/></inertial>"),
            {":3: link 'tip'", "inertia tensor is not positive"}},
        Bad{"branch",
            "<robot name=\"r\">\n<link name=\"base\"/>\n<link name=\"fork\"/>\n<link name=\"left\"/>\n<link "
            "name=\"right\"/>\n"
            "<joint name=\"j1\" type=\"continuous\"><parent link=\"base\"/><child link=\"fork\"/></joint>\n"
            "<joint name=\"j2\" type=\"continuous\"><parent link=\"fork\"/><child link=\"left\"/></joint>\n"
            "<joint name=\"j3\" type=\"continuous\"><parent link=\"fork\"/><child link=\"right\"/></joint>\n</robot>\n",
            {":3: link 'fork'", "branches", "j2", "j3"}}),
    [](const auto& parameter) { return parameter.param.name; });

TEST(Urdf, MissingFileIsNamed) {
  try {
    read_urdf("/nowhere/arm.urdf");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("/nowhere/arm.urdf"), std::string::npos);
  }
}

TEST(Urdf, KinematicsAreEnough) {
  const Robot robot = read_urdf(write(one_joint("revolute", z + "<limit lower=\"-2\" upper=\"1\"/>")));
  ASSERT_EQ(robot.size(), 1U);
  EXPECT_EQ(robot.joints[0].limits->lower, -2);
  EXPECT_EQ(robot.joints[0].limits->upper, 1);
  EXPECT_EQ(robot.joints[0].limits->effort, 0);  // not known
  EXPECT_EQ(robot.joints[0].limits->velocity, 0);
}

TEST(Urdf, ARobotMayStandFarFromTheWorldsOrigin) {
  EXPECT_EQ(read_urdf(write(one_joint("continuous", z + "<origin xyz=\"40 25 0\"/>"))).size(), 1U);
}

TEST(Urdf, ReadsPuma560) {
  const Robot robot = read_urdf(test::puma560);
  ASSERT_EQ(robot.size(), 6U);
  EXPECT_EQ(robot.joints[1].name, "joint_2");
  EXPECT_EQ(robot.joints[1].link, "link_2");
  EXPECT_EQ(robot.joints[1].limits->effort, 186.4);
  EXPECT_EQ(robot.joints[1].limits->velocity, 1.5);
  EXPECT_EQ(robot.joints[1].inertial->mass, 17.4);
  // Moments of link 4 are given in a turned frame: izz there is iyy of the table.
  EXPECT_NEAR(robot.joints[3].inertial->tensor(2, 2), 1.3e-3, 1e-18);
}

TEST(Urdf, MergesFixedJointsAndIgnoresBareSideBranches) {
  const std::string body =
      "<inertial><mass value=\"2\"/><inertia ixx=\"0.1\" iyy=\"0.1\" izz=\"0.1\" ixy=\"0\" ixz=\"0\" "
      "iyz=\"0\"/></inertial>";
  const Robot robot = read_urdf(write(
      "<robot name=\"r\"><link name=\"world\"/><link name=\"base\"/><link name=\"arm\">" + body +
      "</link><link name=\"flange\">" + body +
      "</link><link name=\"camera\"/><link name=\"slide\"/>"
      "<joint name=\"mount\" type=\"fixed\"><parent link=\"world\"/><child link=\"base\"/><origin xyz=\"0 0 "
      "1\"/></joint>"
      "<joint name=\"turn\" type=\"continuous\"><parent link=\"base\"/><child link=\"arm\"/><origin xyz=\"1 0 0\"/>"
      "<axis xyz=\"0 0 2\"/></joint>"
      "<joint name=\"tool\" type=\"fixed\"><parent link=\"arm\"/><child link=\"flange\"/><origin xyz=\"0.4 0 "
      "0\"/></joint>"
      "<joint name=\"eye\" type=\"fixed\"><parent link=\"arm\"/><child link=\"camera\"/></joint>"
      "<joint name=\"push\" type=\"prismatic\"><parent link=\"flange\"/><child link=\"slide\"/><axis xyz=\"1 0 0\"/>" +
      limit + "</joint></robot>"));
  ASSERT_EQ(robot.size(), 2U);
  EXPECT_EQ(robot.joints[0].origin.translation(), Eigen::Vector3d(1, 0, 1));
  EXPECT_EQ(robot.joints[0].axis, Eigen::Vector3d(0, 0, 1));
  EXPECT_TRUE(robot.joints[0].continuous);
  EXPECT_EQ(robot.joints[0].inertial->mass, 4);
  EXPECT_NEAR(robot.joints[0].inertial->centre.x(), 0.2, 1e-15);
  EXPECT_NEAR(robot.joints[0].inertial->tensor(2, 2), 0.2 + 4 * 0.04, 1e-15);  // two bodies, 0.2 m from the centre
  EXPECT_EQ(robot.joints[1].type, JointType::prismatic);
  EXPECT_EQ(robot.joints[1].origin.translation(), Eigen::Vector3d(0.4, 0, 0));
  EXPECT_FALSE(robot.joints[1].inertial.has_value());
}

TEST(Urdf, RoundedRightAnglesAreRightAngles) {
  const Robot robot =
      read_urdf(write("<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><link name=\"c\"/>"
                      "<joint name=\"j1\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/><origin "
                      "rpy=\"1.5708 0 3.14159\"/></joint>"
                      "<joint name=\"j2\" type=\"continuous\"><parent link=\"b\"/><child link=\"c\"/><origin xyz=\"0 1 "
                      "0\" rpy=\"-1.5708 0 0\"/>"
                      "<axis xyz=\"1 1e-9 0\"/></joint></robot>"));
  EXPECT_EQ(robot.joints[0].axis, Eigen::Vector3d(1, 0, 0));  // the default of the format
  EXPECT_EQ(robot.joints[0].origin.linear()(2, 1), 1);
  EXPECT_EQ(robot.joints[0].origin.linear()(0, 0), -1);
  const DhChain chain = to_dh(robot);  // parallel axes
  EXPECT_EQ(chain.links[1].sin_alpha, 0);
  EXPECT_EQ(chain.links[1].p.x, 1);
}

TEST(ForwardKinematics, OriginsFollowFromTheDefinitionOfAJoint) {
  test::Chains chains(11);
  for (int trial = 0; trial < 50; ++trial) {
    Robot robot = chains.robot(6);
    robot.joints[2].fixed_frames = {chains.vector(0.3), chains.vector(0.3)};
    const Eigen::VectorXd q = chains.joints(6, 3);
    const auto poses = test::poses(robot, q);
    const Eigen::Matrix3Xd origins = link_origins(robot, q);
    ASSERT_EQ(origins.cols(), 8);
    for (std::size_t i = 0; i < 6; ++i) {
      const auto column = static_cast<Eigen::Index>(i < 3 ? i : i + 2);
      EXPECT_LT((origins.col(column) - poses[i].translation()).norm(), 1e-12);
    }
    for (std::size_t k = 0; k < 2; ++k) {
      const Eigen::Vector3d expected = poses[2] * robot.joints[2].fixed_frames[k];
      EXPECT_LT((origins.col(static_cast<Eigen::Index>(3 + k)) - expected).norm(), 1e-12);
    }
  }
}

TEST(ForwardKinematics, TheFlangeIsTheLastOrigin) {
  const auto file = write(
      "<robot name=\"r\"><link name=\"base\"/><link name=\"arm\"/><link name=\"flange\"/><link name=\"tool\"/>"
      "<joint name=\"j\" type=\"revolute\"><parent link=\"base\"/><child link=\"arm\"/><origin xyz=\"0 0 1\"/>"
      "<axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" velocity=\"1\" effort=\"1\"/></joint>"
      "<joint name=\"f\" type=\"fixed\"><parent link=\"arm\"/><child link=\"flange\"/><origin xyz=\"1 0 0\"/></joint>"
      "<joint name=\"t\" type=\"fixed\"><parent link=\"flange\"/><child link=\"tool\"/><origin xyz=\"0.5 0 "
      "0.2\"/></joint>"
      "</robot>");
  const Eigen::Matrix3Xd origins = link_origins(read_urdf(file), Eigen::VectorXd::Constant(1, std::numbers::pi / 2));
  ASSERT_EQ(origins.cols(), 3);
  EXPECT_LT((origins.col(0) - Eigen::Vector3d(0, 0, 1)).norm(), 1e-12);
  EXPECT_LT((origins.col(1) - Eigen::Vector3d(0, 1, 1)).norm(), 1e-12);
  EXPECT_LT((origins.col(2) - Eigen::Vector3d(0, 1.5, 1.2)).norm(), 1e-12);
}

}  // namespace
}  // namespace fxdyn
