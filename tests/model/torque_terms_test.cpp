// The torque of the golden tables term by term: the terms add up to it, whatever effects remember.

#include "model/torque_terms.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "tests/golden/remembers/tables.hpp"

namespace fxdyn {
namespace {

using Terms = TorqueTerms<tables::Model>;
using Column = Terms::Column;

/// In the middle of the ranges and, from there, a tenth of them towards their ends.
Column position(const Terms& terms, double share) {
  Column out = terms.middle_of_ranges();
  for (int i = 0; i < Terms::joints; ++i) out[i] += (i % 2 == 0 ? 1 : -1) * 0.1 * share;
  return out;
}
Column alternating(double size) {
  Column out;
  for (int i = 0; i < Terms::joints; ++i) out[i] = i % 2 == 0 ? size : -size / 2;
  return out;
}

class TermsOfTheGoldenTables : public testing::Test {
 protected:
  Terms terms{tables::parameters};
  Saturations cut;
  Column zero = Column::Zero();
};

TEST_F(TermsOfTheGoldenTables, AddUpToTheTorque) {
  const Column q = position(terms, 1), dq = alternating(0.3), ddq = alternating(0.5);
  const Column whole = terms.torque(q, dq, ddq, cut);
  EXPECT_TRUE(whole.allFinite());
  EXPECT_LT((terms.torque_without_friction(q, dq, ddq, cut) + terms.friction(dq, cut) - whole).norm(), 1e-12);
  // At rest there is neither friction nor Coriolis torque.
  EXPECT_EQ(terms.torque(q, zero, zero, cut), terms.gravity(q, cut));
  EXPECT_LT(terms.friction(zero, cut).norm(), 1e-12);
  EXPECT_LT(terms.coriolis(q, zero, cut).norm(), 1e-12);
  // In the middle of the ranges nothing else acts while the robot does not accelerate.
  const Column middle = terms.middle_of_ranges();
  const Column sum = terms.gravity(middle, cut) + terms.coriolis(middle, dq, cut) + terms.friction(dq, cut);
  EXPECT_LT((terms.torque(middle, dq, zero, cut) - sum).norm(), 1e-12);
}

TEST_F(TermsOfTheGoldenTables, FrictionTurnsWithTheVelocityAndCoriolisDoesNot) {
  const Column q = position(terms, 1), dq = alternating(0.3);
  EXPECT_LT((terms.friction(dq, cut) + terms.friction(-dq, cut)).norm(), 1e-12);
  EXPECT_LT((terms.coriolis(q, dq, cut) - terms.coriolis(q, -dq, cut)).norm(), 1e-12);
  for (int i = 0; i < Terms::joints; ++i) EXPECT_GT(terms.friction(dq, cut)[i] * dq[i], 0) << i;
}

TEST_F(TermsOfTheGoldenTables, WhatEffectsRememberHasSettled) {
  // A tick after the start presliding has hardly begun.
  const Column q = position(terms, 1), dq = alternating(0.3);
  tables::Model::Setpoints setpoints;
  for (int i = 0; i < Terms::joints; ++i) {
    setpoints.q[i] = {static_cast<std::int32_t>(std::lround(std::ldexp(q[i], tables::Formats::position)))};
    setpoints.dq[i] = {static_cast<std::int32_t>(std::lround(std::ldexp(dq[i], tables::Formats::velocity)))};
    setpoints.ddq[i] = {0};
  }
  tables::Model::State state{};
  tables::Model::Torques tau;
  Column first;
  for (int tick = 0; tick < SettledTorque::most_ticks; ++tick) {
    tau = tables::Model::tick(tables::parameters, state, setpoints, cut);
    for (int i = 0; i < Terms::joints && tick == 0; ++i) first[i] = std::ldexp(tau[i].raw, -tables::Formats::torque);
  }
  const Column settled = terms.torque(q, dq, zero, cut);
  EXPECT_GT((settled - first).norm(), 0.1);
  for (int i = 0; i < Terms::joints; ++i)
    EXPECT_NEAR(settled[i], std::ldexp(tau[i].raw, -tables::Formats::torque), 0.02 * std::fabs(settled[i]) + 1e-3) << i;
}

/// Its torque is the number of ticks so far, up to `settles`.
struct CountsTicks {
  static constexpr std::size_t joints = 1, outputs = 1;
  using Numbers = tables::Numbers;
  using Torques = std::array<Torque<Numbers>, 1>;
  struct Parameters {
    int settles;
    mutable int asked;
  };
  struct State {
    int ticks = 0;
  };
  struct Setpoints {
    std::array<Position<Numbers>, 1> q;
    std::array<Velocity<Numbers>, 1> dq;
    std::array<Acceleration<Numbers>, 1> ddq;
  };
  static Torques tick(const Parameters& parameters, State& state, const Setpoints&, Saturations&) {
    ++parameters.asked;
    state.ticks = std::min(state.ticks + 1, parameters.settles);
    return {Torque<Numbers>{state.ticks << Torque<Numbers>::bits}};
  }
};

TEST_F(TermsOfTheGoldenTables, WhatIsRememberedIsHeldUntilItStandsStillForASecondAtMost) {
  const TorqueTerms<CountsTicks>::Column still = TorqueTerms<CountsTicks>::Column::Zero();
  for (const int settles : {1, 2, 40, 400}) {
    const CountsTicks::Parameters parameters{settles, 0};
    EXPECT_EQ(TorqueTerms<CountsTicks>(parameters).torque(still, still, still, cut)[0], settles);
    EXPECT_EQ(parameters.asked, settles + 4);  // five equal ones
  }
  const CountsTicks::Parameters never{1000, 0};
  EXPECT_EQ(TorqueTerms<CountsTicks>(never).torque(still, still, still, cut)[0], 500);
  EXPECT_EQ(never.asked, SettledTorque::most_ticks);
  EXPECT_DOUBLE_EQ(SettledTorque::most_ticks * 0.002, 1.0);  // of the ticks that the tables are made for
}

TEST_F(TermsOfTheGoldenTables, TheMiddleIsAsFarFromBothEndsOfTheRanges) {
  const Column middle = terms.middle_of_ranges();
  for (int i = 0; i < Terms::joints; ++i) {
    const auto& limits = tables::parameters.constants[static_cast<std::size_t>(i)].limits;
    const double upper = std::ldexp(limits.q_upper.raw, -tables::Formats::position);
    const double lower = std::ldexp(limits.q_lower.raw, -tables::Formats::position);
    EXPECT_GT(upper - middle[i], 0) << i;
    EXPECT_DOUBLE_EQ(upper - middle[i], middle[i] - lower) << i;
  }
}

TEST_F(TermsOfTheGoldenTables, InertiaTimesAnAccelerationIsWhatItAddsToTheTorque) {
  const Column q = position(terms, 1);
  const Terms::Matrix inertia = terms.inertia(q, cut);
  for (int i = 0; i < Terms::joints; ++i) {
    const Column ddq = 0.5 * Column::Unit(i);
    // To a play: gears that bend, with backlash, are no pure inertia.
    const Column added = (terms.torque(q, zero, ddq, cut) - terms.torque(q, zero, -ddq, cut)) / 2;
    EXPECT_NEAR(added[i], inertia(i, i) * ddq[i], 0.02 * std::fabs(added[i]) + 1e-3) << i;
  }
  EXPECT_EQ(cut.count, 0U);
}

TEST_F(TermsOfTheGoldenTables, InertiaAsksForNoAccelerationBeyondALimit) {
  tables::Model::Parameters weak = tables::parameters;
  for (std::size_t i = 0; i < Terms::joints; ++i) {
    auto& limits = weak.constants[i].limits;
    auto& limit = i % 2 == 0 ? limits.ddq_upper : limits.ddq_lower;
    limit.raw /= 2;
  }
  EXPECT_GT(Terms(weak).inertia(position(terms, 1), cut).diagonal().minCoeff(), 0);
  EXPECT_EQ(cut.count, 0U);
}

TEST_F(TermsOfTheGoldenTables, InertiaIsSymmetricAndPositive) {
  const Terms::Matrix inertia = terms.inertia(position(terms, 1), cut);
  EXPECT_GT(inertia.diagonal().minCoeff(), 0);
  // Saturation and gears that bend leave the symmetry of the bodies to a few per cent.
  EXPECT_LT((inertia - inertia.transpose()).norm(), 0.05 * inertia.norm());
}

TEST_F(TermsOfTheGoldenTables, StatesBeyondTheLimitsAreLimitedAndCounted) {
  terms.gravity(terms.middle_of_ranges(), cut);
  EXPECT_EQ(cut.count, 0U);
  const Column far = Column::Constant(1e6);
  const Column limited = terms.gravity(far, cut);
  EXPECT_GT(cut.count, 0U);
  EXPECT_TRUE(limited.allFinite());
  const Column none = Column::Constant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(terms.gravity(none, cut), terms.gravity(zero, cut));
}

}  // namespace
}  // namespace fxdyn
