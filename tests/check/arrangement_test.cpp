#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <numbers>

#include "host_tools/check/arrangement_search.hpp"
#include "host_tools/check/column_words.hpp"
#include "host_tools/support/random.hpp"
#include "tests/support/chains.hpp"
#include "tests/support/kdl.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
constexpr double degree = std::numbers::pi / 180;

/// Samples of a robot with KDL's inverse dynamics and a friction of another form than the check's, noise of 1 %. The
/// URDF that the check gets has masses that are up to 30 % off.
struct Recorded {
  Robot robot;
  TorqueSamples samples;

  /// @param locked a joint whose brake is on
  explicit Recorded(Index locked = -1, const std::filesystem::path& urdf = test::puma560,
                    const Eigen::Vector3d& gravity = {0, 0, -9.81})
      : robot(read_urdf(urdf)) {
    robot.gravity = gravity;
    const KDL::Chain chain = test::to_kdl(robot);
    const Eigen::Vector3d g = robot.gravity;
    KDL::ChainIdSolver_RNE solver(chain, KDL::Vector(g.x(), g.y(), g.z()));
    constexpr Index rows = 300;
    const auto n = static_cast<Index>(robot.size());
    Random random(5);
    for (Eigen::MatrixXd* columns : {&samples.q, &samples.dq, &samples.ddq, &samples.tau}) columns->resize(rows, n);
    for (Index k = 0; k < rows; ++k) {
      const auto size = static_cast<unsigned>(robot.size());
      KDL::JntArray q(size), dq(size), ddq(size), tau(size);
      for (unsigned j = 0; j < robot.size(); ++j) {
        const double reach = robot.joints[j].type == JointType::revolute ? 1 : 0.05;
        q(j) = random.uniform(-2, 2) * reach;
        dq(j) = random.uniform(-1.5, 1.5) * reach;
        ddq(j) = random.uniform(-5, 5) * reach;
        if (static_cast<Index>(j) != locked) continue;
        q(j) = 0.4;
        dq(j) = ddq(j) = 0;
      }
      solver.CartToJnt(q, dq, ddq, KDL::Wrenches(chain.getNrOfSegments()), tau);
      for (unsigned j = 0; j < robot.size(); ++j) {
        const double scale = j < 3 ? 4 : 0.3;
        const double friction = scale * std::copysign(std::sqrt(std::fabs(dq(j))), dq(j)) + 0.5 * scale * dq(j);
        samples.q(k, j) = q(j);
        samples.dq(k, j) = dq(j);
        samples.ddq(k, j) = ddq(j);
        samples.tau(k, j) = static_cast<Index>(j) == locked ? 3 : (tau(j) + friction) * (1 + 0.01 * random.normal());
      }
    }
    samples.independent = rows;
    for (std::size_t i = 0; i < robot.size(); ++i) {
      robot.joints[i].inertial->mass *= i % 2 == 0 ? 1.3 : 0.7;
      robot.joints[i].inertial->tensor *= i % 2 == 0 ? 1.3 : 0.7;
    }
  }

  std::vector<ArrangementFinding> check() const {
    const ArrangementOptions options;
    return find_mistakes(ArrangementEvidence(robot, samples, options), options);
  }
  void scale_motion(Index joint, double by) {
    for (Eigen::MatrixXd* columns : {&samples.q, &samples.dq, &samples.ddq}) columns->col(joint) *= by;
  }
};

void expect_alone(const std::vector<ArrangementFinding>& found, Mistake mistake, Index joint) {
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(to_string(found[0].move.mistake), to_string(mistake));
  EXPECT_EQ(found[0].move.joint, joint);
  EXPECT_LT(found[0].after, 0.7 * found[0].before);
}

TEST(Arrangement, OfASoundRobotIsLeftAlone) { EXPECT_TRUE(Recorded().check().empty()); }

TEST(Arrangement, SwappedJointsAreFound) {
  Recorded recorded;
  for (Eigen::MatrixXd* columns :
       {&recorded.samples.q, &recorded.samples.dq, &recorded.samples.ddq, &recorded.samples.tau})
    columns->col(1).swap(columns->col(2));
  const auto found = recorded.check();
  expect_alone(found, Mistake::swapped_joints, 1);
  EXPECT_EQ(found[0].move.other, 2);
}

TEST(Arrangement, SwappedTorquesAreFound) {
  Recorded recorded;
  recorded.samples.tau.col(0).swap(recorded.samples.tau.col(3));
  const auto found = recorded.check();
  expect_alone(found, Mistake::swapped_torques, 0);
  EXPECT_EQ(found[0].move.other, 3);
}

TEST(Arrangement, MirrorsAreToldApart) {
  for (const auto& [mistake, motion, torque] :
       {std::tuple{Mistake::mirrored_joint, -1, -1}, std::tuple{Mistake::mirrored_motion, -1, 1},
        std::tuple{Mistake::mirrored_torque, 1, -1}}) {
    Recorded recorded;
    recorded.scale_motion(2, motion);
    recorded.samples.tau.col(2) *= torque;
    expect_alone(recorded.check(), mistake, 2);
  }
}

TEST(Arrangement, AZeroThatIsOffIsMeasured) {
  Recorded recorded;
  recorded.samples.q.col(1).array() += 37 * degree;
  const auto found = recorded.check();
  expect_alone(found, Mistake::zero, 1);
  EXPECT_NEAR(found[0].move.value, -37 * degree, 3 * degree);
}

TEST(Arrangement, GravityOfAWallIsFound) {
  Recorded recorded;
  recorded.robot.gravity = Eigen::Vector3d(9.81, 0, 0);  // the logs: along -z
  const auto found = recorded.check();
  expect_alone(found, Mistake::gravity, 0);
  EXPECT_GT(found[0].move.direction.normalized().dot(-Eigen::Vector3d::UnitZ()), std::cos(5 * degree));
}

// Axes that are all parallel to gravity feel as much of it when it is turned over: the smaller change is a tilt.
TEST(Arrangement, ATiltUnderParallelAxesIsNoOtherGravity) {
  const auto arm = std::filesystem::path(FXDYN_SOURCE_DIR) / "tests/campaign/arm.urdf";
  Recorded recorded(-1, arm, {0.3, -9.8, 0.2});
  recorded.robot.gravity = Eigen::Vector3d(0, -9.81, 0);
  for (const ArrangementFinding& finding : recorded.check()) ADD_FAILURE() << to_string(finding.move.mistake);
}

TEST(Arrangement, AnotherAxisIsFound) {
  Recorded recorded;
  recorded.robot.joints[1].axis = Eigen::Vector3d::UnitX();
  const Robot sound = read_urdf(test::puma560);
  const auto found = recorded.check();
  expect_alone(found, Mistake::axis, 1);
  EXPECT_GT(found[0].move.direction.dot(sound.joints[1].axis), 0.9);
}

TEST(Arrangement, GainsAndUnitsAreFound) {
  Recorded recorded;
  recorded.samples.tau.col(1) /= 2;
  const auto found = recorded.check();
  expect_alone(found, Mistake::torque_gain, 1);
  EXPECT_NEAR(found[0].move.value, 2, 0.3);
  Recorded degrees;
  degrees.scale_motion(2, 1 / degree);
  expect_alone(degrees.check(), Mistake::position_unit, 2);
}

// A slide in mm is a thousand times as fast as the joints that turn. They move all the same.
TEST(Arrangement, ASlideInMillimetresIsFound) {
  Recorded recorded(-1, std::filesystem::path(FXDYN_SOURCE_DIR) / "tests/campaign/scara.urdf");
  EXPECT_TRUE(recorded.check().empty());
  const auto slide = std::find_if(recorded.robot.joints.begin(), recorded.robot.joints.end(),
                                  [](const Joint& joint) { return joint.type == JointType::prismatic; });
  ASSERT_NE(slide, recorded.robot.joints.end());
  const auto at = static_cast<Index>(slide - recorded.robot.joints.begin());
  recorded.scale_motion(at, 1000);
  const ArrangementEvidence evidence(recorded.robot, recorded.samples, {});
  for (Index j = 0; j < static_cast<Index>(recorded.robot.size()); ++j) EXPECT_TRUE(evidence.moves(j)) << j;
  const auto found = recorded.check();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(to_string(found[0].move.mistake), "position_unit");
  EXPECT_EQ(found[0].move.joint, at);
  EXPECT_DOUBLE_EQ(found[0].move.value, 1e-3);
}

// What tells a slide in mm from one whose torque is a thousand times too small is the length of its rail alone: there
// is nothing else on it, and nothing hangs from it.
TEST(Arrangement, TheWayThatAJointGoesIsPartOfTheEvidence) {
  Recorded recorded(-1, std::filesystem::path(FXDYN_SOURCE_DIR) / "tests/campaign/scara.urdf");
  Arrangement wide = as_given(recorded.robot);
  wide.motion_gain[2] = 1000;
  ArrangementOptions options;
  const ArrangementEvidence with(recorded.robot, recorded.samples, options);
  options.beyond = 0;
  const ArrangementEvidence without(recorded.robot, recorded.samples, options);
  const auto [lower, upper] = with.range(2);
  const Limits& limits = *recorded.robot.joints[2].limits;
  const double excess = std::log(1000 * (upper - lower) / (2 * (limits.upper - limits.lower)));
  EXPECT_NEAR(with.excess(wide, 2), excess, 1e-12);
  EXPECT_NEAR(with(wide).nats - without(wide).nats, ArrangementOptions().beyond * excess, 1e-9);
  EXPECT_DOUBLE_EQ(with(as_given(recorded.robot)).nats, without(as_given(recorded.robot)).nats);
}

TEST(Arrangement, AJointThatIsLockedIsNotExchangedForAnother) { EXPECT_TRUE(Recorded(2).check().empty()); }

TEST(Arrangement, CurrentsInPlaceOfTorquesAreFound) {
  Recorded recorded;
  recorded.samples.tau /= 9;
  const auto found = recorded.check();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(to_string(found[0].move.mistake), "torque_unit");
  EXPECT_NEAR(std::log(found[0].move.value), std::log(9), 0.4);
}

/// A return spring whose torque is as large as that of its joint.
void add_return_spring(Recorded& recorded, Index joint) {
  const VectorXd bent = recorded.samples.q.col(joint).array() - 0.4;
  recorded.samples.tau.col(joint) += recorded.samples.tau.col(joint).norm() / bent.norm() * bent;
}

// A SCARA feels gravity on its slide alone: gravity that lies, and another axis, seemed to explain such a spring.
TEST(Arrangement, AReturnSpringIsNoMistake) {
  for (Index joint = 0; joint < 4; ++joint) {
    Recorded recorded(-1, std::filesystem::path(FXDYN_SOURCE_DIR) / "tests/campaign/scara.urdf");
    add_return_spring(recorded, joint);
    for (const ArrangementFinding& finding : recorded.check())
      ADD_FAILURE() << "spring at joint " << joint + 1 << ": " << to_string(finding.move.mistake);
  }
}

// A coil spring between the link and the one before it: neither straight nor a sine over the joint's position.
TEST(Arrangement, ABalancerIsNoMistake) {
  Recorded recorded;
  const auto q = recorded.samples.q.col(1).array();
  const double lever = 0.3, free = 0.4;  // of the way to the spring's other end
  const Eigen::ArrayXd length = (1 + lever * lever - 2 * lever * (q + 1.2).cos()).sqrt();
  recorded.samples.tau.col(1).array() += 400 * (1 - free / length) * lever * (q + 1.2).sin();
  EXPECT_TRUE(recorded.check().empty());
}

TEST(Arrangement, BesideASpringMistakesAreFoundAllTheSame) {
  const auto with_spring = [](Index joint) {
    Recorded recorded;
    add_return_spring(recorded, joint);
    return recorded;
  };
  const Robot sound = read_urdf(test::puma560);
  for (const Index joint : {1, 4}) {
    SCOPED_TRACE(fmt::format("spring at joint {}", joint + 1));
    Recorded axis = with_spring(joint);
    axis.robot.joints[1].axis = Eigen::Vector3d::UnitX();
    const auto found = axis.check();
    expect_alone(found, Mistake::axis, 1);
    EXPECT_GT(found[0].move.direction.dot(sound.joints[1].axis), 0.9);
    Recorded mirrored = with_spring(joint);
    mirrored.samples.tau.col(2) *= -1;
    expect_alone(mirrored.check(), Mistake::mirrored_torque, 2);
    Recorded gravity = with_spring(joint);
    gravity.robot.gravity = Eigen::Vector3d(9.81, 0, 0);
    expect_alone(gravity.check(), Mistake::gravity, 0);
  }
}

// The data can't tell the two: a warning, which names both.
TEST(Arrangement, AMistakeThatASpringExplainsAsWellIsNotSure) {
  Project project;
  project.robot = read_urdf(test::puma560);
  ArrangementFinding finding;
  finding.from = finding.move.result = as_given(project.robot);
  finding.move.mistake = Mistake::axis;
  finding.move.joint = finding.felt = 1;
  finding.move.direction = Eigen::Vector3d::UnitX();
  finding.before = 10;
  finding.after = 1;
  finding.move.nats = 100;
  const auto said = [&] { return in_words(finding, finding.from, project, {"t", "q", "tau"}, {}); };
  EXPECT_TRUE(said().error);
  ArrangementMove spring = finding.move;
  spring.mistake = Mistake::spring;
  finding.others = {spring};
  EXPECT_FALSE(said().error);
  EXPECT_EQ(said().kind, "axis");
  EXPECT_NE(said().text.find("; or joint 2 (joint_2) has a spring or a gravity compensator"), std::string::npos)
      << said().text;
}

TEST(Arrangement, TheBestOtherChangesAreNamedAndTheRestIsCounted) {
  Project project;
  project.robot = read_urdf(test::puma560);
  ArrangementFinding finding;
  finding.from = finding.move.result = as_given(project.robot);
  finding.move.mistake = Mistake::mirrored_motion;
  finding.move.nats = 100;
  finding.before = 10;
  finding.after = 1;
  ArrangementMove other = finding.move;
  for (Index joint = 1; joint < 6; ++joint) {
    other.joint = joint;
    other.nats = 90;
    finding.others.push_back(other);
  }
  const CheckFinding said = in_words(finding, finding.from, project, {"t", "q", "tau"}, {});
  ASSERT_EQ(said.others.size(), 5U);
  EXPECT_EQ(said.others[4].joint, 5U);
  EXPECT_EQ(said.others[4].kind, "mirrored_motion");
  EXPECT_NE(said.text.find("or q of joint 4 "), std::string::npos) << said.text;
  EXPECT_EQ(said.text.find("or q of joint 5 "), std::string::npos) << said.text;
  EXPECT_NE(said.text.find("or one of 2 less likely changes"), std::string::npos) << said.text;
}

// Where a change does not halve the error, a URDF without masses needs more evidence.
TEST(Arrangement, WithoutMassesEnoughEvidenceCountsAsAHalvedError) {
  Recorded recorded;
  for (Joint& joint : recorded.robot.joints) joint.inertial.reset();
  recorded.samples.tau.col(0).swap(recorded.samples.tau.col(3));
  ArrangementOptions options;
  options.vague_leaves = 0;
  const ArrangementEvidence evidence(recorded.robot, recorded.samples, options);
  const auto found = find_mistakes(evidence, options);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(to_string(found[0].move.mistake), "swapped_torques");
  options.vague_gain = 1e9;
  EXPECT_TRUE(find_mistakes(evidence, options).empty());
}

// Two mistakes at once, as where a driver counts both from another end.
TEST(Arrangement, OneMistakeAfterTheOther) {
  Recorded recorded;
  recorded.samples.tau.col(2) *= -1;
  recorded.samples.q.col(1).array() += 90 * degree;
  const auto found = recorded.check();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_NE(found[0].move.mistake, found[1].move.mistake);
}

// A URDF made for drawing: the same body in each link. It proves nothing about the logs.
TEST(Arrangement, PlaceholdersInTheUrdfAreNoMistakeOfTheLogs) {
  Recorded recorded;
  for (Joint& joint : recorded.robot.joints) {
    joint.inertial->mass = 1;
    joint.inertial->centre.setZero();
    joint.inertial->tensor = Eigen::Matrix3d::Identity();
  }
  for (const ArrangementFinding& finding : recorded.check())
    EXPECT_EQ(to_string(finding.move.mistake), "torque_unit");  // "placeholders?"
  for (Joint& joint : recorded.robot.joints) joint.inertial.reset();
  EXPECT_TRUE(recorded.check().empty());
  recorded.samples.tau.col(2) *= -1;
  EXPECT_FALSE(recorded.check().empty());
}

/// So many samples from `first` on.
TorqueSamples part(const TorqueSamples& samples, Index first, Index count) {
  TorqueSamples out = samples;
  for (auto [to, from] :
       {std::pair{&out.q, &samples.q}, {&out.dq, &samples.dq}, {&out.ddq, &samples.ddq}, {&out.tau, &samples.tau}})
    *to = from->middleRows(first, count);
  return out;
}

TEST(Arrangement, SamplesAsItHasThemAreItsEvidence) {
  const Recorded recorded;
  Arrangement turned = as_given(recorded.robot);
  std::swap(turned.motion_from[0], turned.motion_from[2]);
  std::swap(turned.torque_from[3], turned.torque_from[5]);
  turned.motion_gain[1] = -1;
  turned.motion_offset[4] = 0.3;
  turned.torque_gain[2] = -1;
  const ArrangementOptions options;
  const ArrangementEvidence as_recorded(recorded.robot, recorded.samples, options),
      as_turned(recorded.robot, arranged(recorded.samples, turned), options);
  EXPECT_NEAR(as_recorded(turned).nats, as_turned(as_given(recorded.robot)).nats, 1e-6);
}

// Other units of all torques may be bodies that are as much heavier, as far as one log and a URDF tell.
TEST(Arrangement, BodiesThatOtherLogsTeachAreKnownInAShortLog) {
  const Recorded recorded;
  const ArrangementOptions options;
  const TorqueSamples others = part(recorded.samples, 0, 250), log = part(recorded.samples, 250, 50);
  const Arrangement given = as_given(recorded.robot);
  const KnownBodies bodies = ArrangementEvidence(recorded.robot, others, options).bodies(given);
  const ArrangementEvidence alone(recorded.robot, log, options), known(recorded.robot, log, options, bodies);
  Arrangement heavy = given;
  heavy.torque_gain *= 3;
  EXPECT_GT(known(heavy).nats - known(given).nats, 2 * (alone(heavy).nats - alone(given).nats));
}

TEST(Arrangement, AxesAndGravityAreNotOfOneLog) {
  Recorded recorded;
  recorded.robot.gravity = Eigen::Vector3d(9.81, 0, 0);
  const ArrangementOptions options;
  for (const ArrangementFinding& finding :
       find_mistakes(ArrangementEvidence(recorded.robot, recorded.samples, options), options, true)) {
    EXPECT_NE(to_string(finding.move.mistake), "gravity");
    EXPECT_NE(to_string(finding.move.mistake), "axis");
    for (const ArrangementMove& other : finding.others) EXPECT_NE(to_string(other.mistake), "gravity");
  }
}

}  // namespace
}  // namespace fxdyn
