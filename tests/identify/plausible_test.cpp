#include "host_tools/identify/plausible.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <gtest/gtest.h>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/signals/fourier.hpp"
#include "host_tools/support/random.hpp"
#include "tests/support/chains.hpp"

#include "tests/support/filter.hpp"

namespace fxdyn {
namespace {

/// A simulated robot with friction, and one log of it with noise of 1 % of the RMS of the torque.
struct Simulated {
  IdentifiedModel plant;
  Log log;

  Simulated(const Robot& robot, std::uint64_t seed, double velocity = 1.5) {
    plant.robot = robot;
    const DhChain chain = to_dh(robot);
    for (std::size_t i = 0; i < robot.size(); ++i) {
      plant.inertia.push_back(to_link_inertia(*robot.joints[i].inertial, chain.urdf_in_dh[i]));
      JointFit joint;
      for (const auto& [name, value] : {std::pair{"coulomb", 2.0}, std::pair{"viscous", 1.0}}) {
        EffectFit effect;
        effect.effect = name;
        effect.linear = {value};
        joint.effects.push_back(effect);
      }
      plant.joints.push_back(joint);
    }
    const auto n = static_cast<Eigen::Index>(robot.size());
    constexpr Eigen::Index samples = 2500;
    log.file = "log.csv";
    log.step_s = 0.004;
    log.t = Eigen::VectorXd::LinSpaced(samples, 0, log.step_s * (samples - 1));
    log.q.resize(samples, n);
    log.dq = log.ddq = log.q;
    for (Eigen::Index j = 0; j < n; ++j) {
      const FourierJoint joint =
          random_fourier(seed * 100 + static_cast<std::uint64_t>(j), 5, 10, {-1.5, 1.5, velocity, 10}, 1);
      for (Eigen::Index k = 0; k < samples; ++k) {
        const FourierState state = evaluate(joint, 10, log.t[k]);
        log.q(k, j) = state.q;
        log.dq(k, j) = state.dq;
        log.ddq(k, j) = state.ddq;
      }
    }
    log.tau = predict(plant, log.q, log.dq, log.ddq, log.step_s);
    Random random(seed);
    for (Eigen::Index j = 0; j < n; ++j) {
      const double sigma = 0.01 * log.tau.col(j).norm() / std::sqrt(static_cast<double>(samples));
      for (Eigen::Index k = 0; k < samples; ++k) log.tau(k, j) += sigma * random.normal();
    }
  }

  std::vector<Suspicion> check() const { return check_with(plant.robot); }
  std::vector<Suspicion> check_with(const Robot& robot) const {
    return check_plausible(robot, {process(log, test::filter_of(100, 20, 0.2))}, plant.joints);
  }
};

Robot puma() { return read_urdf(test::puma560); }

Robot without_inertias(Robot robot) {
  for (Joint& joint : robot.joints) joint.inertial.reset();
  return robot;
}

std::string errors(const std::vector<Suspicion>& list) {
  std::string text;
  for (const Suspicion& s : list) {
    if (s.severity == Severity::error) text += (s.joint ? std::to_string(*s.joint + 1) : "-") + ": " + s.text + "\n";
  }
  return text;
}

TEST(Plausible, ACleanRobotRaisesNoAlarm) {
  EXPECT_TRUE(Simulated(puma(), 1).check().empty());
  test::Chains chains(8);
  for (unsigned k = 0; k < 12; ++k) {
    SCOPED_TRACE(k);
    Robot robot = chains.robot(2 + k % 6, k % 2 == 1);
    robot.gravity = robot.gravity.normalized() * 9.81;
    const auto list = Simulated(robot, 10 + k).check();
    EXPECT_TRUE(list.empty()) << list.front().text;
  }
}

/// So long that the samples that are looked at are a whole cycle apart: all at one pose they would say anything.
TEST(Plausible, AMotionThatRepeatsItselfRaisesNoAlarm) {
  constexpr Eigen::Index every = 10, cycle = 2500 / every, cycles = 401;
  Simulated s(puma(), 1);
  for (Eigen::MatrixXd* columns : {&s.log.q, &s.log.dq, &s.log.ddq, &s.log.tau}) {
    const Eigen::MatrixXd once = (*columns)(Eigen::seqN(0, cycle, every), Eigen::all);
    *columns = once.replicate(cycles, 1);
  }
  s.log.step_s *= every;
  s.log.t = Eigen::VectorXd::LinSpaced(cycle * cycles, 0, s.log.step_s * static_cast<double>(cycle * cycles - 1));
  EXPECT_EQ(errors(s.check()), "");
  EXPECT_EQ(errors(s.check_with(without_inertias(puma()))), "");
}

TEST(Plausible, NamesEachJointWithTheWrongSign) {
  for (Eigen::Index j = 0; j < 6; ++j) {
    Simulated s(puma(), 2);
    s.log.tau.col(j) *= -1;
    const auto list = s.check_with(without_inertias(puma()));
    ASSERT_EQ(list.size(), 1U) << j << ":\n" << errors(list);
    EXPECT_EQ(list[0].joint, static_cast<std::size_t>(j)) << list[0].text;
    EXPECT_NE(list[0].text.find("wrong sign"), std::string::npos);
  }
  Simulated two(puma(), 2);
  two.log.tau.col(1) *= -1;
  two.log.tau.col(4) *= -1;
  const auto list = two.check_with(without_inertias(puma()));
  ASSERT_EQ(list.size(), 2U) << errors(list);
  EXPECT_EQ(list[0].joint, 1U);
  EXPECT_EQ(list[1].joint, 4U);
}

TEST(Plausible, NamesJointsOfAnyChain) {
  test::Chains chains(9);
  int named = 0, wrong = 0;
  constexpr int cases = 12;
  for (unsigned k = 0; k < cases; ++k) {
    const std::size_t n = 3 + k % 4;
    Robot robot = chains.robot(n, false);
    robot.gravity = {0, 0, -9.81};
    Simulated s(robot, 30 + k);
    s.log.tau.col(k % n) *= -1;
    for (const Suspicion& suspicion : s.check_with(without_inertias(robot))) {
      if (suspicion.severity == Severity::error) (suspicion.joint == k % n ? named : wrong) += 1;
    }
  }
  EXPECT_EQ(named, cases);
  EXPECT_EQ(wrong, 0);
}

TEST(Plausible, KnowsWhenAllAreWrong) {
  Simulated s(puma(), 3);
  s.log.tau *= -1;
  const auto list = s.check_with(without_inertias(puma()));
  ASSERT_EQ(list.size(), 1U) << errors(list);
  EXPECT_NE(list[0].text.find("all joints"), std::string::npos) << list[0].text;
}

TEST(Plausible, KnowsASingleAxis) {
  Robot robot = puma();
  robot.joints.resize(1);
  EXPECT_TRUE(Simulated(robot, 6).check().empty());
  Simulated s(robot, 6);
  s.log.tau *= -1;
  const auto list = s.check_with(without_inertias(robot));
  ASSERT_EQ(list.size(), 1U) << errors(list);
  EXPECT_EQ(list[0].joint, 0U);
}

TEST(Plausible, KnowsGravityThatPointsUp) {
  const Simulated s(puma(), 4);
  Robot robot = without_inertias(puma());
  robot.gravity *= -1;
  const auto list = s.check_with(robot);
  ASSERT_EQ(list.size(), 1U) << errors(list);
  EXPECT_NE(list[0].text.find("robot.gravity"), std::string::npos) << list[0].text;
}

// A link of 39 kg and 1.4 m on joints 0.12 m apart: what the URDF says of it is its flange, or its centre of mass.
TEST(Plausible, MeasuresTheReachToTheFlange) {
  Robot robot;
  for (const double height : {0.0, 0.12}) {
    Joint joint;
    joint.name = "joint_" + std::to_string(robot.size() + 1);
    joint.axis = robot.joints.empty() ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitY();
    joint.origin.translation() = Eigen::Vector3d(0, 0, height);
    joint.inertial = Inertial{1, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity() * 0.01};
    robot.joints.push_back(joint);
  }
  robot.joints[1].inertial = Inertial{39, {0.7, 0, 0}, Eigen::Vector3d(0.1, 6.4, 6.4).asDiagonal()};
  const Simulated s(robot, 6);
  EXPECT_TRUE(s.check().empty());
  Robot unknown = without_inertias(robot);
  ASSERT_EQ(s.check_with(unknown).size(), 1U);
  EXPECT_EQ(s.check_with(unknown)[0].severity, Severity::warning);
  unknown.joints[1].fixed_frames = {{1.4, 0, 0}};
  EXPECT_TRUE(s.check_with(unknown).empty());
}

TEST(Plausible, KnowsMillinewtonmetresAndKilonewtonmetres) {
  for (const double gain : {1000.0, 0.001}) {
    Simulated s(puma(), 5);
    s.log.tau *= gain;
    // A warning: a robot of another build may weigh that much.
    const auto asked = s.check_with(without_inertias(puma()));
    ASSERT_EQ(asked.size(), 1U);
    EXPECT_EQ(asked[0].severity, Severity::warning);
    EXPECT_NE(asked[0].text.find("torque_gain"), std::string::npos) << gain << asked[0].text;
    // the URDF's masses see a factor of 30 already
    s.log.tau *= gain > 1 ? 0.03 : 30;
    const auto list = s.check();
    ASSERT_FALSE(list.empty());
    EXPECT_NE(list[0].text.find("times that of the URDF"), std::string::npos) << list[0].text;
  }
}

}  // namespace
}  // namespace fxdyn
