#include "host_tools/robot/write_urdf.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "tests/support/chains.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

namespace fs = std::filesystem;

/// Bodies in the links' URDF frames, as DH parameters.
std::vector<LinkInertia<Real>> bodies(const Robot& robot, const DhChain& chain, unsigned seed) {
  test::Chains chains(seed);
  std::vector<LinkInertia<Real>> out;
  for (std::size_t i = 0; i < robot.size(); ++i) out.push_back(to_link_inertia(chains.inertial(), chain.urdf_in_dh[i]));
  return out;
}

/// Writes new bodies, reads them back and compares the torques.
std::string expect_reproduced(const fs::path& original, const std::vector<std::string>& comments = {}) {
  Robot robot = read_urdf(original);
  const DhChain chain = to_dh(robot);
  const auto inertia = bodies(robot, chain, 3);
  const fs::path out = test::folder() / "written.urdf";
  write_urdf(original, out, robot, chain, inertia, comments);
  const Robot back = read_urdf(out);
  EXPECT_EQ(back.size(), robot.size());
  for (std::size_t i = 0; i < robot.size(); ++i) {
    robot.joints[i].inertial = to_inertial(inertia[i], chain.urdf_in_dh[i]);
    const Eigen::Vector3d moments =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(back.joints[i].inertial->tensor).eigenvalues();
    EXPECT_GT(moments[0], 0);
    EXPECT_GT(moments[0] + moments[1], moments[2]);
  }
  test::Chains chains(7);
  for (int k = 0; k < 20; ++k) {
    const auto q = chains.joints(robot.size(), 2), dq = chains.joints(robot.size(), 2),
               ddq = chains.joints(robot.size(), 5);
    const Eigen::VectorXd expected = test::torques(robot, q, dq, ddq);
    EXPECT_LT((test::torques(back, q, dq, ddq) - expected).norm(), 1e-9 * expected.norm());
  }
  return read_file(out);
}

TEST(WriteUrdf, ReproducesTheTorqueOfThePuma) { expect_reproduced(test::puma560); }

const std::string awkward = R"(<?xml version="1.0"?>
<!-- <link name="arm"><inertial/></link> is not a link -->
<robot name='r &amp; d'>
  <link name="base"><inertial><mass value="9"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="arm"/>
	<link name='flange'>
	  <visual><geometry><mesh filename="a>b.stl"/></geometry></visual>
	  <inertial>
	    <origin xyz="0 0 0.1"/><mass value="2"/>
	    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
	  </inertial>
	</link>
  <link name="slide" ><visual><geometry><box size="1 1 1"/></geometry></visual></link>
  <link name="tool">
    <inertial><mass value="3"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <!-- keep me -->
  </link>
  <joint name="j1" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>
  <joint name="f1" type="fixed"><parent link="arm"/><child link="flange"/><origin xyz="0 0 0.5" rpy="0.3 0 0"/></joint>
  <joint name="j2" type="prismatic"><parent link="flange"/><child link="slide"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" velocity="1" effort="1"/></joint>
  <joint name="f2" type="fixed"><parent link="slide"/><child link="tool"/><origin xyz="0.1 0 0"/></joint>
</robot>
)";

TEST(WriteUrdf, ReplacesInsertsAndMergesAndLeavesTheRestAlone) {
  const fs::path file = test::write("awkward.urdf", awkward);
  const std::string text = expect_reproduced(file);
  for (const char* kept : {"<!-- <link name=\"arm\"><inertial/></link> is not a link -->", "a>b.stl",
                           "<!-- keep me -->", "<mass value=\"9\"/>", "<link name=\"slide\" >"}) {
    EXPECT_NE(text.find(kept), std::string::npos) << kept;
  }
  EXPECT_EQ(text.find("<mass value=\"2\"/>"), std::string::npos);
  EXPECT_EQ(text.find("<mass value=\"3\"/>"), std::string::npos);
  // Once written, only numbers change: writing the same bodies again gives the same bytes.
  const fs::path first = test::write("first.urdf", text);
  EXPECT_EQ(expect_reproduced(first), text);
}

TEST(WriteUrdf, AnInertialHasItsLinksComment) {
  const fs::path file = test::write("commented.urdf", awkward);
  const std::string text = expect_reproduced(file, {"data_share mass 0.03", "first --- then"});
  EXPECT_NE(text.find("<inertial>\n      <!-- data_share mass 0.03 -->\n      <origin"), std::string::npos) << text;
  // Two hyphens end a comment for some readers and are an error for others.
  EXPECT_NE(text.find("<!-- first - - - then -->"), std::string::npos) << text;
  // The next time they take the place of these.
  const fs::path first = test::write("commented_first.urdf", text);
  EXPECT_EQ(expect_reproduced(first, {"data_share mass 0.03", "first --- then"}), text);
  EXPECT_EQ(expect_reproduced(first), expect_reproduced(file));
}

TEST(WriteUrdf, KeepsLineEndings) {
  std::string dos = awkward;
  for (std::size_t at = 0; (at = dos.find('\n', at)) != std::string::npos; at += 2) dos.replace(at, 1, "\r\n");
  const std::string text = expect_reproduced(test::write("dos.urdf", dos));
  for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; ++at) ASSERT_EQ(text[at - 1], '\r');
}

TEST(WriteUrdf, RefusesAnotherRobotsFile) {
  const Robot robot = read_urdf(test::puma560);
  const DhChain chain = to_dh(robot);
  const fs::path file = test::write("other.urdf", awkward);
  test::expect_refused(file, {"no link 'link_1'"},
                       [&] { write_urdf(file, test::folder() / "never.urdf", robot, chain, bodies(robot, chain, 1)); });
  EXPECT_FALSE(fs::exists(test::folder() / "never.urdf"));
}

}  // namespace
}  // namespace fxdyn
