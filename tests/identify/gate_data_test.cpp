// What identify reads, and the limits and ratings that it begins with.

#include "host_tools/identify/gate_data.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "tests/support/files.hpp"
#include "tests/support/pendulum.hpp"

namespace fxdyn {
namespace {

const IdentifiedModel plant = test::model_of(test::pendulum(2), {test::effect_fit("viscous", {}, {1.5})});

/// A project of that robot with nothing but logs of these roles, written to the test's folder.
Project project_of(const std::vector<Role>& roles) {
  Project project;
  project.file = test::write("gate.toml", "# the text does not matter here\n");
  project.urdf = project.file;
  project.robot = plant.robot;
  for (std::size_t i = 0; i < roles.size(); ++i) {
    LogEntry entry;
    entry.file = test::folder() / ("gate_" + std::to_string(i) + ".csv");
    entry.role = roles[i];
    write_log(entry.file, test::exact_log(plant, roles[i], i + 1, 10));
    project.logs.push_back(entry);
  }
  return project;
}

bool has_note(const GateData& data, const std::string& part) {
  return std::any_of(data.notes.begin(), data.notes.end(),
                     [&](const std::string& note) { return note.find(part) != std::string::npos; });
}

TEST(GateData, HoldsTrainThenValidateAndNeverReadsTest) {
  Project project = project_of({Role::test, Role::validate, Role::train});
  std::filesystem::remove(project.logs[0].file);  // nobody misses it
  const GateData data = read_gate_data(project, test::folder());
  ASSERT_EQ(data.logs.size(), 2U);
  EXPECT_EQ(data.logs[0].role, Role::train);
  EXPECT_EQ(data.references[0].file, "gate_2.csv");
  EXPECT_EQ(data.references[0].hash, hash_of_file(project.logs[2].file));
  EXPECT_EQ(data.references[1].role, "validate");
}

TEST(GateData, ExtremesAreThoseOfAllLogs) {
  const Project project = project_of({Role::train, Role::validate});
  const GateData data = read_gate_data(project, test::folder());
  const Log a = test::exact_log(plant, Role::train, 1, 10), b = test::exact_log(plant, Role::validate, 2, 10);
  for (Eigen::Index j = 0; j < 2; ++j) {
    // The torque is the raw one; of the motion the filter's edges are left out, where these series stand still.
    EXPECT_DOUBLE_EQ(data.largest_torque[j],
                     std::max(a.tau.col(j).cwiseAbs().maxCoeff(), b.tau.col(j).cwiseAbs().maxCoeff()));
    const double fastest = std::max(a.dq.col(j).cwiseAbs().maxCoeff(), b.dq.col(j).cwiseAbs().maxCoeff());
    EXPECT_NEAR(data.dq[j], fastest, 0.01 * fastest);
    EXPECT_NEAR(data.q_upper[j], std::max(a.q.col(j).maxCoeff(), b.q.col(j).maxCoeff()), 0.01);
    EXPECT_NEAR(data.q_lower[j], std::min(a.q.col(j).minCoeff(), b.q.col(j).minCoeff()), 0.01);
  }
}

TEST(GateData, NotesSayWhatIsAssumed) {
  Project project = project_of({Role::train});
  GateData data = read_gate_data(project, test::folder());
  EXPECT_TRUE(has_note(data, "limits not in the project"));
  EXPECT_TRUE(has_note(data, "one trajectory fits and judges"));
  EXPECT_TRUE(has_note(data, "robot.rated_torque not in the project"));
  project = project_of({Role::train, Role::validate});
  project.rated_torque = {20, 10};
  project.limits.position = {{-2, 2}, {-2, 2}};
  project.limits.velocity = project.limits.acceleration = {20, 20};
  EXPECT_TRUE(read_gate_data(project, test::folder()).notes.empty());
  // A torque that stays at the project's limit for 40 ms.
  Log log = test::exact_log(plant, Role::train, 1, 10);
  log.tau.col(1).segment(1000, 10).setConstant(30);
  write_log(project.logs[0].file, log);
  project.limits.torque = {0, 30};
  data = read_gate_data(project, test::folder());
  ASSERT_EQ(data.notes.size(), 1U);
  EXPECT_EQ(data.notes[0],
            "gate_0.csv: torque of joint 2 (joint_2) stays at its limit for 10 samples: left out of the fit");
}

TEST(GateData, WithoutATrainLogThereIsNothingToLearnFrom) {
  const Project project = project_of({Role::validate});
  test::expect_refused(project.file, {"role = \"train\""}, [&] { read_gate_data(project, test::folder()); });
}

TEST(GateData, ATorqueThatNeverChangesIsRefusedWhereTheJointMoves) {
  Log log = test::exact_log(plant, Role::train, 1, 2);
  log.tau.col(1).setConstant(0.25);
  EXPECT_THROW(check_torque(log, plant.robot), DataError);
  log.q.col(1).setConstant(0.5);  // parked
  EXPECT_NO_THROW(check_torque(log, plant.robot));
}

/// Two joints that moved within -1 .. 1.5 and to 2 rad/s, 10 rad/s^2 and 8 N*m.
GateData moved() {
  GateData data;
  data.q_lower = Eigen::VectorXd::Constant(2, -1);
  data.q_upper = Eigen::VectorXd::Constant(2, 1.5);
  data.dq = Eigen::VectorXd::Constant(2, 2);
  data.ddq = Eigen::VectorXd::Constant(2, 10);
  data.largest_torque = Eigen::VectorXd::Constant(2, 8);
  return data;
}

TEST(InitialJoints, WithoutLimitsAreAFifthWiderThanTheLogs) {
  Project project;
  project.robot = test::pendulum(2);
  const JointFit joint = initial_joints(project, moved())[1];
  EXPECT_DOUBLE_EQ(joint.rated_torque, 8);
  EXPECT_DOUBLE_EQ(joint.tau_limit, 9.6);
  EXPECT_DOUBLE_EQ(joint.dq_limit, 2.4);
  EXPECT_DOUBLE_EQ(joint.ddq_limit, 12);
  EXPECT_DOUBLE_EQ(joint.q_lower, 0.25 - 1.2 * 1.25);
  EXPECT_DOUBLE_EQ(joint.q_upper, 0.25 + 1.2 * 1.25);
  EXPECT_DOUBLE_EQ(joint.sign_width, 0.02);
}

TEST(InitialJoints, TakeTheUrdfsLimitsWhereTheLogsComeWithinAFactorOfTen) {
  Project project;
  project.robot = test::pendulum(2);
  project.robot.joints[0].limits = Limits{-3, 3, 19, 60};
  project.robot.joints[1].limits = Limits{-1e3, 1e3, 21, 1e6};  // placeholders
  const std::vector<JointFit> joints = initial_joints(project, moved());
  EXPECT_DOUBLE_EQ(joints[0].dq_limit, 19);
  EXPECT_DOUBLE_EQ(joints[0].tau_limit, 60);
  EXPECT_DOUBLE_EQ(joints[0].q_lower, -3);
  EXPECT_DOUBLE_EQ(joints[1].dq_limit, 2.4);
  EXPECT_DOUBLE_EQ(joints[1].tau_limit, 9.6);
  EXPECT_DOUBLE_EQ(joints[1].q_upper, 1.75);
  // A wrist that turned little in the logs keeps the turns that it has; a slide's placeholder has none.
  project.robot.joints[0].limits = Limits{-20, 20, 19, 60};
  project.robot.joints[1].limits = Limits{-20, 20, 19, 60};
  project.robot.joints[1].type = JointType::prismatic;
  EXPECT_DOUBLE_EQ(initial_joints(project, moved())[0].q_lower, -20);
  EXPECT_DOUBLE_EQ(initial_joints(project, moved())[1].q_lower, 0.25 - 1.2 * 1.25);
  project.robot.joints[1].type = JointType::revolute;
  // A motion beyond the URDF's limits keeps its room.
  project.robot.joints[0].limits = Limits{-0.5, 3, 1.5, 60};
  EXPECT_DOUBLE_EQ(initial_joints(project, moved())[0].q_lower, -1);
  EXPECT_DOUBLE_EQ(initial_joints(project, moved())[0].dq_limit, 2);
}

TEST(InitialJoints, TheProjectsOwnComeFirst) {
  Project project;
  project.robot = test::pendulum(2);
  project.robot.joints[1].limits = Limits{-3, 3, 19, 60};
  project.rated_torque = {7, 5};
  project.limits.position = {{-1, 1}, {-2, 4}};
  project.limits.velocity = {1, 3};
  project.limits.acceleration = {1, 30};
  project.limits.torque = {1, 12};
  const JointFit joint = initial_joints(project, moved())[1];
  EXPECT_EQ(joint.rated_torque, 5);
  EXPECT_EQ(joint.q_lower, -2);
  EXPECT_EQ(joint.q_upper, 4);
  EXPECT_EQ(joint.dq_limit, 3);
  EXPECT_EQ(joint.ddq_limit, 30);
  EXPECT_EQ(joint.tau_limit, 12);
}

}  // namespace
}  // namespace fxdyn
