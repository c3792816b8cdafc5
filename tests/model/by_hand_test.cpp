// Formulas of the model worked out by hand: quick, and with nothing in common with the code that they check.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <ostream>
#include <vector>

#include "model/broad_learning.hpp"
#include "model/catalogue.hpp"
#include "model/joint_model.hpp"
#include "model/rigid_body.hpp"

namespace fxdyn {
namespace {

/// phi of an effect's first tick: q = 0, dq = -3, ddq = 2, sign = -0.5, structural -8, total 5; the other joint's the
/// same but for dq = 7 and ddq = 11.
template <class E>
std::vector<double> phi(std::array<double, 3> shape = {}) {
  const std::array<JointInput<Real>, 2> peers{{{0, -3, 2, -0.5}, {0, 7, 11, 0.75}}};
  const JointInput<Real> input{0, -3, 2, -0.5, -8, 5, peers};
  std::array<Real::Word, 3> words{};
  for (std::size_t i = 0; i < E::shape.size(); ++i) words[i] = E::stored_shape(i, shape[i], 0.5);
  typename E::template State<Real> state{};
  Saturations saturations;
  std::vector<double> out(E::linear.size());
  E::template basis<Real>(input, Words<Real>{words.data()}, state, saturations,
                          [&](auto, std::size_t i, double value) { out.at(i) = value; });
  return out;
}
using Phi = std::vector<double>;

TEST(ByHand, EffectsWithoutMemory) {
  EXPECT_EQ(phi<Viscous>(), Phi{-3});
  EXPECT_EQ(phi<Coulomb>(), Phi{-0.5});
  EXPECT_EQ(phi<Offset>(), Phi{1});
  EXPECT_EQ(phi<RotorInertia>(), Phi{2});
  EXPECT_EQ(phi<AsymmetricFriction>(), (Phi{0.5, 3}));
  EXPECT_EQ(phi<ViscousQuadratic>(), Phi{-9});
  EXPECT_EQ(phi<ViscousCubic>(), Phi{-27});
  EXPECT_EQ(phi<LoadFriction>(), Phi{-4});
  EXPECT_EQ(phi<TorqueGain>(), Phi{5});
  EXPECT_EQ(phi<Spring>(), (Phi{0, 1}));
  EXPECT_EQ(phi<Ripple>({7}), (Phi{1, 0}));
  EXPECT_EQ(phi<GravityCompensator>(), (Phi{1, 0}));
  EXPECT_EQ(phi<Eccentricity>(), (Phi{0, 1}));
  EXPECT_EQ(phi<Saturation>({4}), Phi{-1});
  EXPECT_EQ(phi<Saturation>({6}), Phi{0});
  EXPECT_EQ(phi<JointCoupling>({2}), (Phi{0.75, 7}));
  EXPECT_NEAR(phi<Stribeck>({3})[0], -0.5 * 0.36787944117144233, 1e-12);  // exp(-1)
  EXPECT_NEAR(phi<Backlash>({8})[0], -0.7615941559557649, 1e-9);          // tanh(-1)
  const auto coupled = phi<MotorCoupling>({2, 0.5, 0.25});                // -3 + 0.5 * 7 = 0.5
  EXPECT_NEAR(coupled[0], 0.9640275800758169, 1e-9);                      // tanh(2)
  EXPECT_EQ(coupled[1], 3.5);
  EXPECT_EQ(coupled[2], 5.5);
}

constexpr JointLimits<Real> no_limits{-1e3, 1e3, -1e3, 1e3, -1e3, 1e3, -1e3, 1e3};
constexpr double per_second = 2;

/// What a step leaves of q = 100, dq = 0, ddq = 0: the deflection and, changed in sign, its derivatives.
struct Step {
  double delta, rate, acceleration;
  bool operator==(const Step&) const = default;
  friend void PrintTo(const Step& step, std::ostream* out) {
    *out << step.delta << ' ' << step.rate << ' ' << step.acceleration;
  }
};
struct Deflects {
  Deflection<Real> state;
  Saturations saturations;
  Step step(double delta) {
    const auto link = state.step({100, 0, 0}, delta, per_second, no_limits, saturations);
    return {100 - link.q, -link.dq, -link.ddq};
  }
  void skip(std::uint32_t times) { state.skip(times, per_second, saturations); }
  ~Deflects() { EXPECT_EQ(saturations.count, 0U); }
};

TEST(ByHand, ADeflectionIsDifferentiatedFromItsSecondTickOn) {
  Deflects joint;
  EXPECT_EQ(joint.step(1), (Step{1, 0, 0}));
  EXPECT_EQ(joint.step(3), (Step{3, 4, 0}));
  EXPECT_EQ(joint.step(7), (Step{7, 8, 8}));
  EXPECT_EQ(joint.step(13), (Step{13, 12, 8}));
  EXPECT_EQ(joint.step(20), (Step{20, 14, 4}));
  EXPECT_EQ(joint.state.ticks, 4U);
}

TEST(ByHand, OverTicksWithoutSetpointsADeflectionKeepsItsAcceleration) {
  Deflects joint;
  for (const double delta : {1, 3, 7, 13}) joint.step(delta);
  Deflects once = joint;
  once.skip(1);  // 6 a tick after 4 a tick: 8, to 21
  EXPECT_EQ(once.state.delta, 21);
  EXPECT_EQ(once.state.rate, 16);
  joint.skip(2);  // and 10, to 31
  EXPECT_EQ(joint.state.delta, 31);
  EXPECT_EQ(joint.state.rate, 20);
  EXPECT_EQ(joint.step(42), (Step{42, 22, 4}));
  joint.skip(2);  // one change of its own only: 11 twice more, to 64
  EXPECT_EQ(joint.state.delta, 64);
  EXPECT_EQ(joint.step(76), (Step{76, 24, 4}));
  EXPECT_EQ(joint.step(89), (Step{89, 26, 4}));
  joint.skip(1);  // 13 after 12: 14, to 103
  EXPECT_EQ(joint.step(118), (Step{118, 30, 4}));
}

TEST(ByHand, ADeflectionBeginsAnewWhereTooLittleOrTooOldIsKnown) {
  Deflects young;
  young.step(1);
  young.step(3);
  young.skip(1);
  EXPECT_EQ(young.step(9), (Step{9, 0, 0}));
  EXPECT_EQ(young.step(11), (Step{11, 4, 0}));
  EXPECT_EQ(young.step(14), (Step{14, 6, 4}));
  young.skip(1);  // three ticks are enough to go on, by 3 to 17
  EXPECT_EQ(young.step(20), (Step{20, 6, 0}));
  Deflects unborn;
  unborn.skip(1);
  EXPECT_EQ(unborn.step(5), (Step{5, 0, 0}));
  Deflects old;
  for (const double delta : {1, 2, 3, 4}) old.step(delta);
  Deflects older = old;
  old.skip(3);
  EXPECT_EQ(old.state.delta, 7);
  EXPECT_EQ(old.step(8), (Step{8, 2, 0}));
  older.skip(4);
  EXPECT_EQ(older.step(8), (Step{8, 0, 0}));
  Deflects twice;
  for (const double delta : {1, 2, 3, 4}) twice.step(delta);
  twice.skip(1);
  twice.skip(1);  // one gap, one call
  EXPECT_EQ(twice.step(6), (Step{6, 0, 0}));
}

TEST(ByHand, ARampIsAnEighthOfItsArgumentUpToEight) {
  EXPECT_EQ(RampNodes::of(-0.5), 0);
  EXPECT_EQ(RampNodes::of(0), 0);
  EXPECT_EQ(RampNodes::of(0.5), 0.0625);
  EXPECT_EQ(RampNodes::of(4), 0.5);
  EXPECT_EQ(RampNodes::of(7), 0.875);
  EXPECT_EQ(RampNodes::of(9), 1);
}

// --- rigid bodies ----------------------------------------------------------------------------------------------------

LinkInertia<Real> point_mass(double m, double x) { return {m, {m * x, 0, 0}, m * x * x}; }
using TwoLinks = std::array<LinkGeometry<Real>, 2>;
using TwoBodies = std::array<LinkInertia<Real>, 2>;
using TwoJoints = std::array<JointState<Real>, 2>;
using TwoTorques = std::array<double, 2>;
constexpr double g = 9.81;

/// Gravity along -y of the base, its z axis being joint 1's.
TwoTorques inverse_dynamics(const TwoLinks& links, const TwoBodies& bodies, const TwoJoints& joints) {
  std::array<LinkMotion<Real>, 2> motions;
  std::array<Wrench<Real>, 2> wrenches;
  TwoTorques tau{};
  rnea<Real, 2>(links, bodies, {0, g, 0}, joints, motions, wrenches, tau);
  return tau;
}

// Two point masses at the ends of two links in a vertical plane: Craig, Introduction to Robotics, Eq. 6.58.
TEST(ByHand, AnArmOfTwoLinksInAPlane) {
  const double l1 = 2, l2 = 0.7, m1 = 3, m2 = 5;
  const TwoJoints joints{{{0.3, 0.9, -1.3}, {0.8, -0.6, 2.1}}};
  const auto [q1, dq1, ddq1] = joints[0];
  const auto [q2, dq2, ddq2] = joints[1];
  const TwoLinks links{{{JointType::revolute, 1, 0, {0, 0, 0}}, {JointType::revolute, 1, 0, {l1, 0, 0}}}};
  const TwoBodies bodies{point_mass(m1, l1), point_mass(m2, l2)};
  const double c2 = std::cos(q2), s2 = std::sin(q2), far = m2 * l2 * l2 * (ddq1 + ddq2), both = m2 * l1 * l2,
               outer_weight = m2 * l2 * g * std::cos(q1 + q2);
  const double tau1 = far + both * c2 * (2 * ddq1 + ddq2) + (m1 + m2) * l1 * l1 * ddq1 - both * s2 * dq2 * dq2 -
                      2 * both * s2 * dq1 * dq2 + outer_weight + (m1 + m2) * l1 * g * std::cos(q1);
  const double tau2 = both * c2 * ddq1 + both * s2 * dq1 * dq1 + outer_weight + far;
  const TwoTorques tau = inverse_dynamics(links, bodies, joints);
  EXPECT_NEAR(tau[0], tau1, 1e-12);
  EXPECT_NEAR(tau[1], tau2, 1e-12);
  TwoTorques unrolled{};
  using Planar = Link<JointType::revolute, Twist::none>;
  rnea_of<Real, 0, Planar, Planar>(links, bodies, {0, g, 0}, joints, unrolled);
  EXPECT_NEAR(unrolled[0], tau1, 1e-12);
  EXPECT_NEAR(unrolled[1], tau2, 1e-12);
}

// A mass that slides along a turning link, in polar coordinates: m (r'' - r phi'^2), m (r^2 phi'' + 2 r r' phi').
TEST(ByHand, AMassThatSlidesAlongATurningLink) {
  const double m = 3;
  const TwoJoints joints{{{0.4, 1.1, -0.7}, {1.5, -0.8, 0.6}}};
  const auto [q, dphi, ddphi] = joints[0];
  const auto [r, dr, ddr] = joints[1];
  const double phi = q - raw::pi / 2;  // the second joint's axis is -y of the first link
  const TwoLinks links{{{JointType::revolute, 1, 0, {0, 0, 0}}, {JointType::prismatic, 0, 1, {0, 0, 0}}}};
  const TwoTorques tau = inverse_dynamics(links, {point_mass(0, 0), point_mass(m, 0)}, joints);
  EXPECT_NEAR(tau[0], m * (r * r * ddphi + 2 * r * dr * dphi + g * r * std::cos(phi)), 1e-12);
  EXPECT_NEAR(tau[1], m * (ddr - r * dphi * dphi + g * std::sin(phi)), 1e-12);
}

// --- Broad Learning System -------------------------------------------------------------------------------------------

// Three nodes whose activation is an eighth of their argument, over x = [q, dq, ddq] and the curved velocity.
TEST(ByHand, TheBasisOfABroadLearningSystem) {
  const double curved = 0.881373587019543;                         // asinh(1)
  const std::vector<double> words{0.5, 0.5, 0.25, 0.25, 0.5, 0.5,  // middle, then one over: see StateInputs
                                  4,   1,   2,    -4,   0,         // bias, weights
                                  1,   2,   4,    0,    0,         //
                                  0.5, 0,   0,    0,    4};
  JointInput<Real> input{};
  input.q = 1;
  input.dq = 2;
  input.ddq = -3;
  NoState state;
  Saturations saturations;
  std::array<double, 3> scratch{};
  std::vector<double> out(7);
  broad_learning_basis<StateInputs, RampNodes, Real>(3, input, Words<Real>{words.data()}, state, saturations, scratch,
                                                     [&](auto, std::size_t i, double value) { out.at(i) = value; });
  const std::vector<double> expected{0.25, 0.5, -0.75, curved / 2, 1, 3.5 / 8, (0.5 + 2 * curved) / 8};
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(out[i], expected[i], 1e-9) << i;
}

// The same inputs; the torque is 2 q' - dq' + 4 ddq' + 8 curved + 16 h_1 + 32 h_2.
TEST(ByHand, TheTorqueOfABroadLearningSystem) {
  const double curved = 0.881373587019543;
  const std::vector<double> words{0.5, 0.5, 0.25, 0.25, 0.5, 0.5,  //
                                  4,   1,   2,    -4,   0,         // bias, weights
                                  1,   2,   4,    0,    0,         //
                                  2,   -1,  4,    8,    16,  32};
  JointInput<Real> input{};
  input.q = 1;
  input.dq = 2;
  input.ddq = -3;
  NoState state;
  Saturations saturations;
  std::array<double, 2> scratch{};
  const double torque = broad_learning_sum<StateInputs, RampNodes, Real>(2, 0, input, Words<Real>{words.data()}, state,
                                                                         saturations, scratch);
  EXPECT_NEAR(torque, 2 * 0.25 - 0.5 - 4 * 0.75 + 8 * curved / 2 + 16 * 1 + 32 * 3.5 / 8, 1e-9);
}

static_assert(PhysicalInputs::size == 4 && BristlesInputs::size == 6 && ExtendedInputs::size == 8 &&
              StateInputs::size == 4);

// From rest, one tick at dq = 2 rad/s: the mean is 1 rad/s. Bell e^-1 at a Stribeck velocity of 2 rad/s.
TEST(ByHand, TheBristlesThatABroadLearningSystemSees) {
  const BroadLearningScales scales{
      .reference_velocity = 2, .span = 2, .distances = {0.01, 0.02, 0.04}, .velocity = 4, .stribeck = 2, .share = 0.5};
  const auto words = BristlesInputs::stored(scales, 0.002);
  BristlesInputs::State<Real> state{};
  Saturations saturations;
  JointInput<Real> input{};
  input.dq = 2;
  const auto u = BristlesInputs::values<Real>(input, Words<Real>{words.data()}, state, saturations);
  const double bell = 0.367879441171442, n = 0.5 + 0.5 * bell;
  EXPECT_NEAR(u[0], 0.881373587019543 / 2, 1e-12);
  // y = n (1 - exp(-1 rad/s * 2 ms / (distance n)))
  EXPECT_NEAR(u[1], n * (1 - std::exp(-0.2 / n)), 1e-12);
  const double middle = n * (1 - std::exp(-0.1 / n));
  EXPECT_NEAR(u[2], middle, 1e-12);
  EXPECT_NEAR(u[3], n * (1 - std::exp(-0.05 / n)), 1e-12);
  EXPECT_NEAR(u[4], (2 - 2 * middle / n) / 4, 1e-12);
  EXPECT_NEAR(u[5], 2 * bell - 1, 1e-12);
  // The way back: s is that of the mean of both velocities, -1 rad/s.
  input.dq = -4;
  const auto back = BristlesInputs::values<Real>(input, Words<Real>{words.data()}, state, saturations);
  const double slow = 0.5 + 0.5 * std::exp(-4.0), e = std::exp(-0.1 / slow);
  EXPECT_NEAR(back[2], middle * e - slow * (1 - e), 1e-12);
  EXPECT_NEAR(back[4], (-4 - 4 * back[2] / slow) / 4, 1e-12);
}

struct Formats {
  static constexpr int position = 20, velocity = 20, acceleration = 20, linear_acceleration = 20, length = 24,
                       force = 20, torque = 16, inverse_velocity = 20, inverse_path = 20, weight = 20,
                       velocity_squared = 20, velocity_cubed = 20, inverse_position = 20, inverse_torque = 20,
                       force_sum = 40, torque_sum = 40, deflection_sum = 40;
};

TEST(ByHand, ANumberInAnotherFormatIsTheSameNumber) {
  using N = FixedNumbers<Formats>;
  EXPECT_EQ(N::convert<Fixed<24>>(Fixed<20>{3}).raw, 3 << 4);
  EXPECT_EQ(N::convert<Fixed<24>>(Fixed<20>{-3}).raw, -3 * 16);
  EXPECT_EQ(N::convert<Fixed<20>>(Fixed<20>{7}).raw, 7);
  EXPECT_EQ(N::convert<Fixed<16>>(Fixed<20>{40}).raw, 3) << "2.5, half up";
  EXPECT_EQ(N::convert<Fixed<16>>(Fixed<20>{-40}).raw, -2);
}

TEST(ByHand, ACrossProduct) {
  const auto c = cross(Vector3<double>{1, 2, 3}, Vector3<double>{4, 5, 6});
  EXPECT_EQ(c.x, -3);
  EXPECT_EQ(c.y, 6);
  EXPECT_EQ(c.z, -3);
}

}  // namespace
}  // namespace fxdyn
