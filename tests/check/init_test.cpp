#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <sstream>

#include "host_tools/check/column_guess.hpp"
#include "host_tools/check/course.hpp"
#include "host_tools/check/init.hpp"
#include "tests/support/files.hpp"

namespace fxdyn {
namespace {

using test::write;
using Names = std::vector<std::string>;

std::filesystem::path two_joints() {
  std::string text = "<robot name=\"r\"><link name=\"base\"/>";
  std::string parent = "base";
  for (const std::string joint : {"shoulder", "elbow"}) {
    text += fmt::format(
        "<link name=\"{0}_link\"><inertial><mass value=\"3\"/><inertia ixx=\".1\" iyy=\".1\" izz=\".1\" ixy=\"0\" "
        "ixz=\"0\" iyz=\"0\"/></inertial></link><joint name=\"{0}\" type=\"revolute\"><parent link=\"{1}\"/><child "
        "link=\"{0}_link\"/><axis xyz=\"0 1 0\"/><limit lower=\"-3\" upper=\"3\" velocity=\"3\" "
        "effort=\"50\"/></joint>",
        joint, parent);
    parent = joint + "_link";
  }
  return write("two.urdf", text + "</robot>");
}

/// The columns of a file that names them, without its rows.
ColumnGuess guess_of(const Names& names, const Robot& robot) {
  return guess_columns(CsvHead{names, {}, names.size()}, robot);
}

CsvHead head_of(const std::string& line) { return read_head(write("head.csv", line + "\n0,1,2,3,4\n1,2,3,4,5\n")); }

/// Rows of t, q, dq where asked for, tau of two joints: at rest for `rest_s` at both ends. q in steps of an encoder.
std::string recording(double speed, bool with_velocity, double rest_s, double scale = 1) {
  std::string text;
  for (int k = 0; k < 5000; ++k) {
    const double t = 0.002 * k, moving = std::clamp(t - rest_s, 0.0, 10 - 2 * rest_s);
    const bool rests = moving != t - rest_s;
    text += fmt::format("{:.4f}", t);
    for (const double w : {speed, 1.3 * speed})
      text += fmt::format(",{:.4f}", scale * 1e-4 * std::round(1e4 * std::sin(w * moving)));
    for (const double w : {speed, 1.3 * speed})
      if (with_velocity) text += fmt::format(",{:.5f}", rests ? 0 : scale * w * std::cos(w * moving));
    text += fmt::format(",{:.4f},{:.4f}\n", 20 * std::cos(moving), 5 * std::sin(3 * moving));
  }
  return text;
}

std::string init(const std::string& name, const std::string& text) {
  return init_project({write(name, text)}, two_joints(), test::folder());
}
void expect_in(const std::string& part, const std::string& text) {
  EXPECT_NE(text.find(part), std::string::npos) << part << "\nis not in\n" << text;
}

TEST(ColumnGuess, ADataSetsStateIsPositionsAndItsActionNone) {
  const Robot robot = read_urdf(two_joints());
  const ColumnGuess numbered = guess_of({"timestamp", "action1", "action2", "observation.state1", "observation.state2",
                                         "observation.effort1", "observation.effort2", "observation.state3"},
                                        robot);
  EXPECT_EQ(numbered.format.joint_columns.at("q"), (Names{"observation.state1", "observation.state2"}));
  EXPECT_EQ(numbered.format.joint_columns.at("tau"), (Names{"observation.effort1", "observation.effort2"}));
  const ColumnGuess named =
      guess_of({"timestamp", "action.elbow.pos", "action.shoulder.pos", "observation.state.elbow.pos",
                "observation.state.elbow.vel", "observation.state.elbow.torque", "observation.state.shoulder.pos",
                "observation.state.shoulder.vel", "observation.state.shoulder.torque"},
               robot);
  EXPECT_EQ(named.format.joint_columns.at("q"),
            (Names{"observation.state.shoulder.pos", "observation.state.elbow.pos"}));
  EXPECT_EQ(named.format.joint_columns.at("dq"),
            (Names{"observation.state.shoulder.vel", "observation.state.elbow.vel"}));
  EXPECT_EQ(named.format.joint_columns.at("tau"),
            (Names{"observation.state.shoulder.torque", "observation.state.elbow.torque"}));
  // Of the tool, and no joints.
  const ColumnGuess tool = guess_of({"timestamp", "observation.state.x", "observation.state.y", "tau1", "tau2"}, robot);
  EXPECT_EQ(tool.missing, Names{"q"});
}

TEST(ColumnGuess, ARecordOfUrRtdeHasCurrentsAndNoTorque) {
  const Robot robot = read_urdf(two_joints());
  const Names names{"timestamp",        "target_q_0",        "target_q_1",       "actual_q_0",
                    "actual_q_1",       "actual_qd_0",       "actual_qd_1",      "target_current_0",
                    "target_current_1", "target_moment_0",   "target_moment_1",  "actual_current_0",
                    "actual_current_1", "actual_TCP_pose_0", "actual_TCP_pose_1"};
  const ColumnGuess guess = guess_of(names, robot);
  EXPECT_EQ(guess.format.columns.at("t"), "timestamp");
  EXPECT_EQ(guess.format.joint_columns.at("q"), (Names{"actual_q_0", "actual_q_1"}));
  EXPECT_EQ(guess.format.joint_columns.at("dq"), (Names{"actual_qd_0", "actual_qd_1"}));
  EXPECT_EQ(guess.format.joint_columns.at("tau"), (Names{"actual_current_0", "actual_current_1"}));
  EXPECT_TRUE(guess.torque_is_current);
}

TEST(ColumnGuess, TakesNamesOfJointsAndNumbersFromZeroOrOne) {
  const Robot robot = read_urdf(two_joints());
  const ColumnGuess by_joint =
      guess_columns(head_of("stamp,position_elbow,position_shoulder,effort_elbow,effort_shoulder"), robot);
  EXPECT_TRUE(by_joint.missing.empty());
  EXPECT_EQ(by_joint.format.columns.at("t"), "stamp");
  EXPECT_EQ(by_joint.format.joint_columns.at("q"), (Names{"position_shoulder", "position_elbow"}));
  EXPECT_EQ(by_joint.format.joint_columns.at("tau"), (Names{"effort_shoulder", "effort_elbow"}));
  EXPECT_FALSE(by_joint.torque_is_current);
  const ColumnGuess from_zero = guess_columns(head_of("time,actual_q_0,actual_q_1,i_0,i_1"), robot);
  EXPECT_EQ(from_zero.format.joint_columns.at("q"), (Names{"actual_q_0", "actual_q_1"}));
  EXPECT_TRUE(from_zero.torque_is_current);
  const ColumnGuess from_one = guess_columns(head_of("t,q1,q2,tau1,tau2"), robot);
  EXPECT_EQ(from_one.format.joint_columns.at("tau"), (Names{"tau1", "tau2"}));
}

TEST(ColumnGuess, ForcesDriveSlidesAlone) {
  Robot robot = read_urdf(two_joints());
  const std::string forces = "t,q1,q2,force_1,force_2", at_tool = "t,q1,q2,actual_TCP_force_1,actual_TCP_force_2";
  EXPECT_EQ(guess_columns(head_of(forces), robot).missing, Names{"tau"});
  robot.joints[0].type = JointType::prismatic;
  EXPECT_EQ(guess_columns(head_of(forces), robot).format.joint_columns.at("tau"), (Names{"force_1", "force_2"}));
  EXPECT_EQ(guess_columns(head_of(at_tool), robot).missing, Names{"tau"});
}

TEST(ColumnGuess, TakesWhatWasMeasuredRatherThanWhatWasAsked) {
  const ColumnGuess guess =
      guess_columns(head_of("t,target_q1,target_q2,actual_q1,actual_q2\n"), read_urdf(two_joints()));
  EXPECT_EQ(guess.format.joint_columns.at("q"), (Names{"actual_q1", "actual_q2"}));
  EXPECT_EQ(guess.missing, Names{"tau"});
}

TEST(ColumnGuess, WithoutNamesTellsVelocitiesFromTorquesByTheMotion) {
  const Robot robot = read_urdf(two_joints());
  const ColumnGuess with = guess_columns(read_head(write("with.csv", recording(2, true, 2))), robot);
  EXPECT_EQ(with.format.joint_columns.at("dq"), (Names{"#3", "#4"}));
  EXPECT_EQ(with.format.joint_columns.at("tau"), (Names{"#5", "#6"}));
  const ColumnGuess without = guess_columns(read_head(write("without.csv", recording(2, false, 2))), robot);
  EXPECT_EQ(without.format.joint_columns.count("dq"), 0U);
  EXPECT_EQ(without.format.joint_columns.at("tau"), (Names{"#3", "#4"}));
}

TEST(Init, WritesColumnsByNumberAndWindowsWithoutStandstill) {
  const std::string project = init("raw.csv", recording(2, true, 2));
  expect_in("columns = { t = 0, dq = [3, 4], q = [1, 2], tau = [5, 6] }", project);
  expect_in("urdf = \"two.urdf\"", project);
  EXPECT_NEAR(std::stod(project.substr(project.find("from_s = ") + 9)), 2, 0.03);
  EXPECT_NEAR(std::stod(project.substr(project.rfind("to_s = ") + 7)), 8, 0.03);
  expect_in("role = \"test\"", project);
  expect_in("fxdyn check", project);
}

TEST(Init, WritesThatDegreesBecomeRadians) {
  const std::string project = init("degrees.csv", recording(2, true, 0, 180 / std::numbers::pi));
  expect_in("position_gain = [0.01745329252, 0.01745329252]", project);
}

TEST(Init, WritesTheUnitOfTimeThatEveryLogHas) {
  const auto with = [](const std::string& name, double unit, const std::string& column = "time") {
    std::string text = column + " q_0 q_1 tau_0 tau_1\n";
    for (int k = 0; k < 3000; ++k) {
      const double t = 0.002 * k;
      text += fmt::format("{:.6g} {:.5f} {:.5f} {:.4f} {:.4f}\n", t * unit, std::sin(2 * t), std::sin(3 * t),
                          std::cos(t), std::cos(5 * t));
    }
    return write(name, text);
  };
  const auto of = [](const std::vector<std::filesystem::path>& logs) {
    return init_project(logs, two_joints(), test::folder());
  };
  expect_in("time_unit = \"ms\"   # by the steps of the time stamps\n", of({with("ms.csv", 1000)}));
  expect_in("role = \"test\"", of({with("ms.csv", 1000)}));
  EXPECT_EQ(of({with("s.csv", 1)}).find("time_unit"), std::string::npos);
  EXPECT_EQ(of({with("ms.csv", 1000), with("s.csv", 1)}).find("time_unit"), std::string::npos);
  EXPECT_EQ(of({with("named.csv", 1000, "t_ms")}).find("time_unit"), std::string::npos);
}

TEST(Init, SaysThatAFileHasOtherLogsToo) {
  const auto file = std::filesystem::path(FXDYN_SOURCE_DIR) / "tests/arrays/files/lerobot.parquet";
  const std::string project = init_project({file}, two_joints(), test::folder());
  expect_in("topic = \"episode_3\"\n", project);
  expect_in("q = [\"observation.state1\", \"observation.state2\"]", project);
  expect_in("tau = [\"observation.effort1\", \"observation.effort2\"]", project);
  expect_in("# one of 3 logs in the file, episode_3 to episode_11; a [[log]] may have the topic of another\n", project);
}

TEST(Init, LeavesOutAVelocityInAnotherUnitThanThePosition) {
  const std::string degrees = recording(2, false, 0, 180 / std::numbers::pi), rad = recording(2, true, 0);
  std::istringstream q(degrees), all(rad);
  std::string text = "t,q1,q2,dq1,dq2,tau1,tau2\n", a, b;
  while (std::getline(q, a) && std::getline(all, b)) {
    std::size_t end = 0, skip = 0;  // the first three fields of a, the last four of b
    for (int k = 0; k < 3; ++k) end = a.find(',', end + 1), skip = b.find(',', skip + 1);
    text += a.substr(0, end) + b.substr(skip) + "\n";
  }
  const std::string project = init("mixed.csv", text);
  expect_in("dq = false }", project);
  expect_in("position_gain = [0.01745329252, 0.01745329252]", project);
}

TEST(Init, GivesEachMotionOneRole) {
  const std::string head = "t,q1,q2,tau1,tau2\n";
  std::vector<std::filesystem::path> logs;
  for (const auto& [name, speed] : {std::pair{"a.csv", 0.1}, std::pair{"b.csv", 0.1}, std::pair{"c.csv", 0.14}})
    logs.push_back(write(name, head + recording(speed, false, 0)));
  const std::string project = init_project(logs, two_joints(), test::folder());
  expect_in("file = \"a.csv\"\nrole = \"train\"", project);
  expect_in("file = \"b.csv\"\nrole = \"train\"", project);
  expect_in("file = \"c.csv\"\nrole = \"test\"", project);
  EXPECT_EQ(project.find("[signals]"), std::string::npos);  // its names are those of a project
}

TEST(Init, SaysWhichColumnsItDoesNotFind) {
  const auto log = write("nothing.csv", "a,b,c\n1,2,3\n4,5,6\n");
  test::expect_refused(log, {"no column is seen for t, q, tau", "--columns '{ t = "},
                       [&] { init_project({log}, two_joints(), test::folder()); });
}

TEST(Init, TakesColumnsThatAreNamed) {
  const std::string text = "a,b,c,d,e\n" + recording(2, false, 0);
  const auto log = write("named.csv", text);
  const std::string by_name = init_project({log}, two_joints(), test::folder(),
                                           "{ t = \"a\", q = [\"c\", \"b\"], tau = { shoulder = 3, elbow = \"e\" } }");
  expect_in("columns = { t = \"a\", q = [\"c\", \"b\"], tau = [3, \"e\"] }", by_name);
  const auto half = write("half.csv", "stamp,q1,q2,x1,x2\n" + recording(2, false, 0));
  expect_in("columns = { t = \"stamp\", q = [\"q1\", \"q2\"], tau = [\"x1\", \"x2\"] }",
            init_project({half}, two_joints(), test::folder(), "{ tau = \"x\" }"));
  test::expect_refused(half, {"no column is seen for tau"},
                       [&] { init_project({half}, two_joints(), test::folder(), "{ q = \"q\" }"); });
  const auto refused = [&](const std::string& columns) {
    return [&, columns] { init_project({half}, two_joints(), test::folder(), columns); };
  };
  test::expect_refused("--columns", {"not valid TOML"}, refused("{ tau = "));
  test::expect_refused("--columns", {"force"}, refused("{ force = \"x\" }"));
}

/// Positions alone tell whether it is one motion: 20 s of two sines, from `from_s` on.
Course course(double w, double from_s, double seconds = 20, double noise = 0) {
  Log log;
  const auto count = static_cast<Eigen::Index>(seconds / 0.004);
  log.t = Eigen::VectorXd::LinSpaced(count, 0, seconds);
  log.q.resize(count, 2);
  for (Eigen::Index k = 0; k < count; ++k) {
    const double t = from_s + log.t[k];
    log.q(k, 0) = std::sin(w * t) + noise * std::sin(991 * t);
    log.q(k, 1) = std::sin(1.7 * w * t + 0.4) * std::cos(0.31 * t);
  }
  return course_of(log, 0, seconds);
}

TEST(Init, TellsMotionsByTheirCourse) {
  const Course once = course(1.3, 0);
  EXPECT_TRUE(same_course(once, course(1.3, 0, 20, 0.005)));
  EXPECT_TRUE(same_course(once, course(1.3, 3.337)));   // begun later
  EXPECT_TRUE(same_course(once, course(1.3, 4.5, 9)));  // a part
  EXPECT_TRUE(same_course(course(1.3, 4.5, 9), once));
  EXPECT_FALSE(same_course(once, course(1.5, 0)));  // fills the same ranges
  EXPECT_FALSE(same_course(once, course(1.3, 40)));
  Course mirrored = once;
  mirrored.q.col(1) *= -1;
  EXPECT_FALSE(same_course(once, mirrored));
}

}  // namespace
}  // namespace fxdyn
