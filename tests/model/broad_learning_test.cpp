// The BLS's sets of inputs and its activations: fixed point against double, and what the tables say of them.

#include "model/broad_learning.hpp"
#include "host_tools/effects/identified_model.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "host_tools/effects/broad_learning_types.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/support/random.hpp"
#include "tests/support/broad_learning.hpp"

namespace fxdyn {
namespace {

struct TestFormats {
  static constexpr int position = 28, velocity = 26, acceleration = 22, linear_acceleration = 24, length = 28;
  static constexpr int force = 20, torque = 22, inverse_velocity = 18, inverse_path = 22, weight = 9;
  static constexpr int velocity_squared = 22, velocity_cubed = 19, inverse_position = 22, inverse_torque = 24;
  static constexpr int force_sum = 44, torque_sum = 44, deflection_sum = 44;
};
using Fixed32 = FixedNumbers<TestFormats>;

Formats run_time_formats() {
  Formats formats;
  for (std::size_t i = 0; i < quantity_count; ++i) formats.quantity[i] = Fixed32::bits(static_cast<Quantity>(i));
  formats.force_sum = formats.torque_sum = formats.deflection_sum = 44;
  return formats;
}

BroadLearningScales scales() {
  BroadLearningScales s;
  s.reference_velocity = 0.05;
  s.torque = 40;
  s.wavenumber = 3;
  s.velocity = 4;
  s.acceleration = 25;
  s.middle = 0.3;
  s.half_range = 2.2;
  return s;
}

/// Inputs over a motion that also leaves the scales, in firmware's fixed point, the host's and double.
template <class Inputs>
void expect_same_inputs() {
  const Formats formats = run_time_formats();
  const FormatScope scope(formats);
  constexpr double tick_s = 0.002;
  const auto stored = Inputs::stored(scales(), tick_s);
  std::vector<double> real;
  std::vector<std::int32_t> fixed;
  for (std::size_t i = 0; i < stored.size(); ++i) {
    fixed.push_back(to_raw(stored[i], formats[Inputs::shape[i]]));
    real.push_back(from_raw(fixed.back(), formats[Inputs::shape[i]]));
  }
  typename Inputs::template State<Fixed32> state{};
  typename Inputs::template State<RunTimeNumbers> run_time_state{};
  typename Inputs::template State<Real> real_state{};
  Saturations none;
  Random random(7);
  std::array<double, Inputs::size> lowest{}, highest{};
  for (int tick = 0; tick < 20000; ++tick) {
    const auto raw = [&](double size, Quantity quantity) {
      return to_raw(size * random.uniform(-1, 1) * (random.uniform() < 0.3 ? 1e-3 : 1), formats[quantity]);
    };
    const std::int32_t q = raw(3, Quantity::position), dq = raw(6, Quantity::velocity),
                       ddq = raw(40, Quantity::acceleration), tau = raw(60, Quantity::torque);
    JointInput<Fixed32> a{{q}, {dq}, {ddq}, {}, {tau}};
    JointInput<RunTimeNumbers> b{{q}, {dq}, {ddq}, {}, {tau}};
    JointInput<Real> c{from_raw(q, 28), from_raw(dq, 26), from_raw(ddq, 22), 0, from_raw(tau, 22)};
    const auto u = Inputs::template values<Fixed32>(a, Words<Fixed32>{fixed.data()}, state, none);
    const auto v =
        Inputs::template values<RunTimeNumbers>(b, Words<RunTimeNumbers>{fixed.data()}, run_time_state, none);
    const auto w = Inputs::template values<Real>(c, Words<Real>{real.data()}, real_state, none);
    for (std::size_t i = 0; i < u.size(); ++i) {
      ASSERT_EQ(u[i].raw, v[i].raw) << "input " << i << ", tick " << tick;
      // half a unit of int16, a whole one at 1; the rest is the functions' and the states' own
      ASSERT_NEAR(from_raw(u[i].raw, small_bits), w[i], 3.1e-5 + 1e-5) << "input " << i << ", tick " << tick;
      lowest[i] = std::fmin(lowest[i], w[i]);
      highest[i] = std::fmax(highest[i], w[i]);
    }
  }
  for (std::size_t i = 0; i < Inputs::size; ++i) {
    EXPECT_LT(lowest[i], -0.8) << "input " << i;
    EXPECT_GT(highest[i], 0.8) << "input " << i;
  }
}

TEST(BroadLearning, PhysicalInputsFollowDouble) { expect_same_inputs<PhysicalInputs>(); }
TEST(BroadLearning, BristlesInputsFollowDouble) { expect_same_inputs<BristlesInputs>(); }
TEST(BroadLearning, ExtendedInputsFollowDouble) { expect_same_inputs<ExtendedInputs>(); }
TEST(BroadLearning, StateInputsFollowDouble) { expect_same_inputs<StateInputs>(); }

TEST(BroadLearning, TheRampIsExactOverItsWholeArgument) {
  for (std::int32_t x = -32768; x <= 32767; ++x) {
    const double argument = std::ldexp(x, -raw::ramp_argument_bits);
    ASSERT_EQ(std::ldexp(raw::ramp(x), -small_bits), RampNodes::of(argument)) << x;
  }
  EXPECT_EQ(RampNodes::of(100), 1.0);
  // Saturated at the end of its argument, it is off by the stated error.
  EXPECT_LE(1 - std::ldexp(raw::ramp(32767), -small_bits), raw::ramp_error);
}

TEST(BroadLearning, WeightedRampsAreTheSumOfDouble) {
  Random random(5);
  for (int round = 0; round < 200; ++round) {
    std::array<std::int32_t, 12> x{};
    std::array<std::int32_t, 6> coefficients{};
    std::int64_t expected = 0;
    for (std::size_t k = 0; k < x.size(); k += 2) {
      const auto word = [&] { return static_cast<std::int32_t>(std::lround(random.uniform(-32768, 32767))); };
      x[k] = word();
      x[k + 1] = word();
      const std::int32_t first = word(), second = word();
      coefficients[k / 2] = raw::pack(first, second);
      expected += std::int64_t{first} * std::max(x[k], 0) + std::int64_t{second} * std::max(x[k + 1], 0);
    }
    ASSERT_EQ(raw::weighted_ramp(x.size(), coefficients.data(), x.data()), expected);
  }
}

template <class Model>
std::uint32_t hash_of() {
  LayoutHash hash;
  Model::hash(hash);
  return hash.value();
}

/// Tables in the field carry these numbers: FNV-1a, 32 bits, of "bls", 40, 15, the kind's names and page version 2,
/// worked out apart from LayoutHash. A change of either hash or layout makes tables that run today refused.
TEST(BroadLearning, EveryKindHasALayoutOfItsOwnAndTheOldOneKeepsIts) {
  EXPECT_EQ((hash_of<BroadLearning<40, 15>>()), 0x092809e0U);  // as it was when there was one kind
  EXPECT_EQ((hash_of<BroadLearning<40, 15, ExtendedInputs>>()), 0x90f6aff2U);
  EXPECT_EQ((hash_of<BroadLearning<40, 15, StateInputs>>()), 0x9788196aU);
  EXPECT_EQ((hash_of<BroadLearning<40, 15, BristlesInputs>>()), 0x7303d345U);
  EXPECT_EQ((hash_of<BroadLearning<40, 15, BristlesInputs, RampNodes>>()), 0xdfc9aec0U);
  EXPECT_EQ((hash_of<BroadLearning<40, 15, PhysicalInputs, RampNodes>>()), 0x7aa53f53U);
  EXPECT_EQ((hash_of<BroadLearning<40, 15, ExtendedInputs, RampNodes>>()), 0x5c476d51U);
  EXPECT_EQ((hash_of<BroadLearning<40, 15, StateInputs, RampNodes>>()), 0x61061c99U);
  static_assert(BroadLearning<40, 15>::words == 5 + 40 * 3 + 4 + 20);
  static_assert(BroadLearning<40, 15, ExtendedInputs>::words == 8 + 40 * 5 + 8 + 20);
}

TEST(BroadLearning, EveryNumberChangesTheTorque) {
  for (const auto& [inputs, activation] : test::bls_kinds()) {
    const IdentifiedModel model = test::joint_with_bls(inputs, activation);
    const Formats formats = choose_formats(model);
    const TickStates states = within_limits(model, 600, 11);
    const Eigen::MatrixXd before = predict_fixed(model, formats, states);
    const auto changed = [&](auto&& change) {
      IdentifiedModel other = model;
      change(*other.joints[0].bls);
      return (predict_fixed(other, formats, states) - before).norm() > 0;
    };
    const std::string kind = inputs + " " + activation;
    const auto scale = [&](auto member, bool read) {
      EXPECT_EQ(changed([&](BroadLearningFit& b) { b.*member *= 1.1; }), read) << kind;
    };
    const bool state = inputs == "state", extended = inputs == "extended", bristles = inputs == "bristles";
    scale(&BroadLearningFit::reference_velocity, true);
    scale(&BroadLearningFit::span, true);
    scale(&BroadLearningFit::torque, extended);
    scale(&BroadLearningFit::wavenumber, extended);
    scale(&BroadLearningFit::acceleration, extended || state);
    scale(&BroadLearningFit::velocity, state || bristles);
    scale(&BroadLearningFit::stribeck, bristles);
    scale(&BroadLearningFit::share, bristles);
    scale(&BroadLearningFit::middle, state);
    scale(&BroadLearningFit::half_range, state);
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_EQ(changed([&](BroadLearningFit& b) { b.distances[i] *= 1.5; }), !state) << kind;
    for (Eigen::Index k = 0; k < model.joints[0].bls->weights.size(); ++k)
      EXPECT_TRUE(changed([&](BroadLearningFit& b) { b.weights.data()[k] += 0.05; })) << kind << " weight " << k;
    for (Eigen::Index k = 0; k < model.joints[0].bls->coefficients.size(); ++k)
      EXPECT_TRUE(changed([&](BroadLearningFit& b) { b.coefficients[k] += 0.05; })) << kind << " coefficient " << k;
  }
}

TEST(BroadLearning, AModelOfAnotherVersionIsRefused) {
  BroadLearningFit fit;
  fit.inputs = "telepathic";
  EXPECT_THROW(bls_inputs(fit), InputError);
  fit.inputs = "state";
  fit.activation = "sine";
  EXPECT_THROW(bls_inputs(fit), InputError);
}

}  // namespace
}  // namespace fxdyn
