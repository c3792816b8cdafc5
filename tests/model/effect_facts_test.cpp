// What effects say of themselves, against what they do: flags, bounds, the numbers of their phi; and the ends of
// limits.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "model/broad_learning.hpp"
#include "model/broad_learning_inputs.hpp"
#include "model/catalogue.hpp"

namespace fxdyn {
namespace {

/// A joint's input at the k-th tick; `peers` belongs to the caller.
JointInput<Real> input(int k, double structural, double total, std::span<const JointInput<Real>> peers) {
  return {0.3 + 0.1 * k, 0.7 - 0.2 * k, -1.1, 0.4, structural + k, total * (k + 1), peers};
}

/// Every phi of three ticks, and which numbers they came under.
template <class E>
std::vector<double> run(double structural, double total, double peer, std::set<std::size_t>* numbers = nullptr) {
  std::array<Real::Word, 3> shape{};
  for (std::size_t i = 0; i < E::shape.size(); ++i) {
    const double value = E::shape[i].name == "joint" ? 1 : E::shape[i].name == "span" ? 3 : 0.02;
    shape[i] = E::stored_shape(i, value, 0.002);
  }
  const std::array<JointInput<Real>, 2> peers{{{0.1 * peer, peer, 2 * peer, 0.5 * peer}, {0.2, 0.3, 0.4, 0.5}}};
  typename E::template State<Real> state{};
  Saturations saturations;
  std::vector<double> out;
  for (int k = 0; k < 3; ++k) {
    E::template basis<Real>(input(k, structural, total, peers), Words<Real>{shape.data()}, state, saturations,
                            [&](auto, std::size_t i, double phi) {
                              out.push_back(phi);
                              if (numbers != nullptr) numbers->insert(i);
                            });
  }
  return out;
}

TEST(EffectFacts, TheFlagsSayWhatIsLookedAt) {
  Catalogue::for_each([]<class E>() {
    const auto before = run<E>(0.05, 0.06, 1);
    EXPECT_EQ(run<E>(0.07, 0.06, 1) != before, needs_structural<E>) << E::name;
    EXPECT_EQ(run<E>(0.05, -0.09, 1) != before, needs_total<E>) << E::name;
    EXPECT_EQ(run<E>(0.05, 0.06, 2) != before, needs_peers<E>) << E::name;
  });
}

TEST(EffectFacts, EveryPhiComesOnceUnderItsOwnNumber) {
  Catalogue::for_each([]<class E>() {
    std::set<std::size_t> numbers;
    EXPECT_EQ(run<E>(1, 2, 1, &numbers).size(), 3 * E::linear.size()) << E::name;
    ASSERT_EQ(numbers.size(), E::linear.size()) << E::name;
    EXPECT_EQ(*numbers.rbegin(), E::linear.size() - 1) << E::name;
  });
}

template <class E>
void bounds_are_sound() {
  for (const ParameterInfo& parameter : E::linear) {
    EXPECT_LT(parameter.lower, parameter.upper) << E::name << " " << parameter.name;
    EXPECT_LE(parameter.lower, 0) << E::name << " " << parameter.name << ": an effect may be absent";
    EXPECT_GT(parameter.upper, 0) << E::name << " " << parameter.name;
  }
  for (const ParameterInfo& parameter : E::shape) {
    EXPECT_LT(parameter.lower, parameter.upper) << E::name << " " << parameter.name;
    if (parameter.name == "joint") {
      EXPECT_EQ(parameter.lower, 1);
      EXPECT_EQ(parameter.upper, 32) << "as many as a model may have";
    }
  }
}
TEST(EffectFacts, BoundsAreSound) {
  Catalogue::for_each([]<class E>() { bounds_are_sound<E>(); });
  BodyEffects::for_each([]<class E>() { bounds_are_sound<E>(); });
}

// From a ripple that repeats after two turns of the joint to one of an encoder's lines.
TEST(EffectFacts, ARippleMayBeSlowAndFast) {
  const ParameterInfo& wavenumber = Ripple::shape[0];
  EXPECT_LE(wavenumber.lower, 0.5);
  EXPECT_GE(wavenumber.upper, 65536);
}

TEST(EffectFacts, ALimitCountsWhatItCutAndNothingElse) {
  Saturations saturations;
  EXPECT_EQ(limit(0.5, -1.0, 1.0, saturations), 0.5);
  EXPECT_EQ(limit(1.0, -1.0, 1.0, saturations), 1.0);
  EXPECT_EQ(saturations.count, 0U);
  EXPECT_EQ(limit(2.0, -1.0, 1.0, saturations), 1.0);
  EXPECT_EQ(limit(-2.0, -1.0, 1.0, saturations), -1.0);
  EXPECT_EQ(saturations.count, 2U);
}

TEST(EffectFacts, ADelayBeyondTheMemoryIsItsLongest) {
  typename Delay::State<Real> state{};
  Saturations saturations;
  const Real::Word longer = 15.5;
  for (int k = 0; k < 40; ++k) {
    JointInput<Real> u{};
    u.total = k * k;
    Delay::basis<Real>(u, Words<Real>{&longer}, state, saturations, [&](auto, std::size_t, double phi) {
      const int before = k < 15 ? 0 : k - 15;
      EXPECT_EQ(phi, before * before - k * k) << k;
    });
  }
}

TEST(EffectFacts, APayloadIsAPointMass) {
  const LinkInertia<Real> link = Payload::add_to(Payload::add_to({}, 2, {3, 5, 7}), 1, {-1, 2, 4});
  EXPECT_EQ(link.m, 3);
  EXPECT_EQ((std::array{link.h.x, link.h.y, link.h.z}), (std::array{5.0, 12.0, 18.0}));
  EXPECT_EQ((std::array{link.xx, link.yy, link.zz}), (std::array{19.0, 54.0, 114.0}));
  EXPECT_EQ((std::array{link.xy, link.xz, link.yz}), (std::array{28.0, 38.0, 78.0}));
}

// up <- Ry(b) Rx(a) up, its matrices written out.
TEST(EffectFacts, ATiltTurnsUpAboutXAndThenAboutY) {
  const double a = 0.3, b = -0.2;
  const Vector3<double> up{0.2, -0.5, 0.7};
  const Vector3<double> after_x{up.x, std::cos(a) * up.y - std::sin(a) * up.z, std::sin(a) * up.y + std::cos(a) * up.z};
  const Vector3<double> turned = GravityTilt::turn(up, a, b);
  EXPECT_NEAR(turned.x, std::cos(b) * after_x.x + std::sin(b) * after_x.z, 1e-15);
  EXPECT_NEAR(turned.y, after_x.y, 1e-15);
  EXPECT_NEAR(turned.z, std::cos(b) * after_x.z - std::sin(b) * after_x.x, 1e-15);
}

template <class Nodes>
void expect_the_largest_slope() {
  for (double from = 0; from <= 3; from += 0.25) {
    double largest = 0;
    for (double x = from; x < 4; x += 1e-4) largest = std::max(largest, (Nodes::of(x + 1e-4) - Nodes::of(x)) / 1e-4);
    EXPECT_NEAR(Nodes::steepest(from), largest, 1e-4) << Nodes::name << " beyond " << from;
  }
}
TEST(EffectFacts, TheSteepestSlopesAreThoseOfTheCurves) {
  expect_the_largest_slope<TanhNodes>();
  expect_the_largest_slope<RampNodes>();
}

TEST(EffectFacts, ScalesOfBroadLearningAreStoredAsTheirReciprocals) {
  const BroadLearningScales scales{.reference_velocity = 0.5,
                                   .span = 4,
                                   .distances = {0.002, 0.004, 0.008},
                                   .torque = 20,
                                   .wavenumber = 3.14159265358979324,
                                   .velocity = 5,
                                   .acceleration = 10,
                                   .middle = 0.25,
                                   .half_range = 8,
                                   .stribeck = 0.1,
                                   .share = 0.75};
  const auto state = StateInputs::stored(scales, 0.002);
  const std::array expected{0.25, 0.125, 0.2, 0.1, 2.0, 0.25};
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_DOUBLE_EQ(state[i], expected[i]) << i;
  const auto extended = ExtendedInputs::stored(scales, 0.002);
  const std::array all{2.0, 0.25, 1.0, 0.5, 0.25, 0.05, 0.5, 0.1};  // half a turn a radian
  for (std::size_t i = 0; i < all.size(); ++i) EXPECT_DOUBLE_EQ(extended[i], all[i]) << i;
  const auto bristles = BristlesInputs::stored(scales, 0.002);
  const std::array words{2.0, 0.25, 1.0, 0.5, 0.25, 10.0, 0.25, 0.2};
  for (std::size_t i = 0; i < words.size(); ++i) EXPECT_DOUBLE_EQ(bristles[i], words[i]) << i;
  const auto unscaled = ExtendedInputs::stored({}, 0.001);
  EXPECT_DOUBLE_EQ(unscaled[6], 0.159154943091895336) << "one ripple a turn";
}

}  // namespace
}  // namespace fxdyn
