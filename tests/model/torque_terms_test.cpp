// The torque of the golden tables term by term: the terms add up to it, whatever effects remember.

#include "model/torque_terms.hpp"

#include <gtest/gtest.h>

#include <cmath>
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
  EXPECT_TRUE(terms.gravity(none, cut).allFinite());
}

}  // namespace
}  // namespace fxdyn
