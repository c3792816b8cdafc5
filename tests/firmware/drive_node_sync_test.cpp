// What the drive node does when SYNC is lost, late, at a wrong rate or gone: docs/guide/node-behaviour.md.

#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/firmware/node_bench.hpp"

namespace fxdyn {
namespace {

using canopen::Abort;
using dictionary::Counter;
using test::Bench;

/// When the setpoints of a SYNC come.
enum class Order {
  before,  ///< just before it
  after    ///< 0.2 ms after the SYNC before it, as CANopen masters send their PDOs
};

/// A master with a clock of its own.
class SyncTest : public ::testing::TestWithParam<Order> {
 protected:
  Bench<> bench;
  std::size_t k = 0;

  void setpoints() { bench.send_setpoints(test::motion(k++)); }
  /// A period of SYNC, `late_us` late; `with_sync` false: it is lost. Joint `missing` (from 1) gets no setpoint.
  void period(bool with_sync = true, std::uint32_t late_us = 0, std::size_t missing = 0,
              std::uint32_t period_us = 2000) {
    const auto send = [&] {
      const auto all = test::motion(k++);
      for (std::size_t j = 0; j < 6; ++j) {
        if (j + 1 != missing) bench.send_setpoint(j, all[j]);
      }
      bench.poll();
    };
    if (GetParam() == Order::before) send();
    bench.pass(late_us);
    if (with_sync) bench.sync();
    bench.pass(200);
    if (GetParam() == Order::after) send();
    bench.pass(period_us - 200 - late_us);
  }
  void run() {
    bench.start();
    for (int i = 0; i < 100; ++i) period();
    stale = bench.counted(Counter::stale_ticks);
    EXPECT_EQ(stale, GetParam() == Order::after ? 1U : 0U);  // the first SYNC has no setpoints yet
    EXPECT_FALSE(bench.node.errors().any());
  }
  std::uint32_t new_stale() const { return bench.counted(Counter::stale_ticks) - stale; }
  std::uint32_t stale = 0;
};

TEST_P(SyncTest, OneLostSyncIsOneStaleTick) {
  run();
  for (int i = 1; i <= 20; ++i) {
    period(false);
    for (int n = 0; n < 10; ++n) period();
    EXPECT_EQ(new_stale(), static_cast<std::uint32_t>(i));
  }
  EXPECT_EQ(bench.counted(Counter::missing_setpoints), GetParam() == Order::after ? 6U : 0U);
  EXPECT_EQ(bench.node.errors().history_count(), 0);  // tolerated: no EMCY
}

TEST_P(SyncTest, SeveralLostSyncsAreAsManyStaleTicks) {
  run();
  for (int i = 0; i < 5; ++i) period(false);
  for (int n = 0; n < 100; ++n) period();
  EXPECT_EQ(new_stale(), 5U);
  EXPECT_FALSE(bench.node.errors().any());
}

// The node's own tick comes half a period after the missed SYNC; one that comes up to a quarter later is that SYNC.
TEST_P(SyncTest, ALateSyncIsOneStaleTickAtMost) {
  for (const std::uint32_t late_us : {100U, 900U, 1100U, 1400U}) {
    const std::uint32_t before = k == 0 ? 0 : new_stale();
    if (k == 0) run();
    period(true, late_us);
    for (int n = 0; n < 100; ++n) period();
    EXPECT_EQ(new_stale() - before, late_us < 1000 ? 0U : 1U) << late_us;
    EXPECT_FALSE(bench.node.errors().any());
  }
}

// A SYNC and a setpoint of the next tick are lost: what waits of that joint is a period older than the others'.
TEST_P(SyncTest, SetpointsOfTwoTicksAreNotMixedAfterALostSync) {
  run();
  const bool after = GetParam() == Order::after;
  std::uint32_t stale_before = 0, missing_before = after ? 6 : 0;
  for (const std::size_t joint : {3U, 1U, 6U}) {
    period(false, 0, after ? joint : 0);
    period(true, 0, after ? 0 : joint);
    EXPECT_EQ(new_stale() - stale_before, 2U) << joint;
    EXPECT_EQ(bench.counted(Counter::missing_setpoints) - missing_before, 1U) << joint;
    for (int n = 0; n < 10; ++n) period();
    EXPECT_EQ(new_stale() - stale_before, 2U) << joint;
    stale_before = new_stale();
    missing_before = bench.counted(Counter::missing_setpoints);
  }
}

// Setpoints that waited for a SYNC of long ago are never used.
TEST_P(SyncTest, SetpointsDoNotOutliveTheRamp) {
  run();
  setpoints();
  bench.poll();
  bench.pass(1'000'000);
  stale = bench.counted(Counter::stale_ticks);
  const auto ticks = bench.counted(Counter::ticks);
  bench.sync();
  EXPECT_EQ(bench.counted(Counter::ticks), ticks);
  EXPECT_EQ(new_stale(), 1U);
}

// --- the rate --------------------------------------------------------------------------------------------------------

TEST_P(SyncTest, AWrongRateIsToldAndTakesTheTorqueAway) {
  for (const std::uint32_t us : {1000U, 1500U, 1900U, 2100U, 2600U}) {
    Bench<> one;
    one.start();
    const auto cycle = [&](std::size_t i, std::uint32_t period_us) {
      one.send_setpoints(test::motion(i));
      one.sync();
      one.pass(period_us);
    };
    for (std::size_t i = 0; i < 300; ++i) cycle(i, 2000);
    EXPECT_FALSE(one.node.errors().any());
    std::size_t noticed = 0;
    for (std::size_t i = 300; i < 600; ++i) {
      cycle(i, us);
      if (noticed == 0 && one.node.errors().is_present(Error::sync_rate)) noticed = i - 299;
    }
    ASSERT_NE(noticed, 0U) << us;
    EXPECT_LE(noticed, us == 1000 ? 9U : 256U) << us;
    EXPECT_TRUE(one.on_wire.fault.level);
    EXPECT_EQ(one.read(0x1003, 1) & 0xFFFF, 0x8700U);
    for (std::size_t j = 0; j < 6; ++j) EXPECT_EQ(one.node.torque(j), 0) << us;
    for (std::size_t i = 600; i < 1400; ++i) cycle(i, 2000);
    EXPECT_FALSE(one.node.errors().any()) << us;
    EXPECT_NE(one.node.torque(1), 0);
  }
}

// 2 % is what a window of 256 periods allows: nothing is said, whatever the jitter.
TEST_P(SyncTest, AGoodRateWithJitterIsNoError) {
  for (const int drift_us : {-20, 0, 20}) {
    Bench<> one;
    one.start();
    std::uint32_t random = 1;
    for (std::size_t i = 0; i < 3000; ++i) {
      random = random * 1664525U + 1013904223U;
      const std::uint32_t late = (random >> 16) % 600;
      one.pass(late);
      one.send_setpoints(test::motion(i));
      one.sync();
      one.pass(static_cast<std::uint32_t>(2000 + drift_us) - late);
      ASSERT_FALSE(one.node.errors().any()) << drift_us << " tick " << i;
    }
  }
}

// Both masters' ticks are answered for as long as nobody knows; then the bus is told, and every torque goes by the
// ramp.
TEST_P(SyncTest, TwoMastersAreNoticed) {
  run();
  std::array<std::int32_t, test::robot_joints> before{}, ramp{};
  for (std::size_t j = 0; j < ramp.size(); ++j) {
    before[j] = bench.node.torque(j);
    ramp[j] = (tables::page.parameters.constants[j].limits.tau_upper.raw + 49) / 50;
  }
  const auto ticks = bench.counted(Counter::ticks);
  std::uint32_t syncs = 0, answered = 0, told_after = 0;
  std::size_t emergencies = 0;
  bench.heard();
  const auto one_sync = [&](std::uint32_t pass_us) {
    bench.sync();
    ++syncs;
    bench.pass(pass_us);
    std::size_t torques = 0;
    for (const auto& frame : bench.heard()) {
      if (frame.id > canopen::torque_id && frame.id <= canopen::torque_id + test::robot_joints) ++torques;
      if (frame.id != canopen::emergency_id + bench.node.id()) continue;
      const auto code = canopen::load<2>(frame.data.data());
      EXPECT_EQ(code, 0x8700);
      ++emergencies;
      told_after = syncs;
      EXPECT_EQ(frame.size, 8);
      EXPECT_NE(frame.data[2] & 0x10, 0) << "error register: communication";
      const auto period_us = canopen::load<2>(&frame.data[3]);  // of the periods since the rate was last right
      EXPECT_GT(period_us, 900U);
      EXPECT_LT(period_us, 2000U);
    }
    answered += torques == test::robot_joints ? 1 : 0;
    for (std::size_t j = 0; j < ramp.size() && emergencies > 0; ++j) {
      EXPECT_LE(std::abs(bench.node.torque(j) - before[j]), ramp[j]) << "joint " << j << ", SYNC " << syncs;
      EXPECT_LE(std::abs(bench.node.torque(j)), std::abs(before[j])) << "joint " << j << ", SYNC " << syncs;
    }
    for (std::size_t j = 0; j < ramp.size(); ++j) before[j] = bench.node.torque(j);
  };
  for (int i = 0; i < 60; ++i) {
    bench.pass(700);
    one_sync(300);  // the other one's
    setpoints();
    one_sync(1000);
  }
  EXPECT_TRUE(bench.node.errors().is_present(Error::sync_rate));
  EXPECT_TRUE(bench.on_wire.fault.level);
  EXPECT_EQ(emergencies, 1U);
  EXPECT_LE(told_after, 20U);
  for (std::size_t j = 0; j < ramp.size(); ++j) EXPECT_EQ(bench.node.torque(j), 0) << j;
  // Nothing is lost: every SYNC is answered with all torques, and is a tick with the setpoints that came or a stale
  // one.
  EXPECT_EQ(answered, syncs);
  EXPECT_EQ(bench.counted(Counter::ticks) - ticks + new_stale(), syncs);
  EXPECT_EQ(new_stale(), GetParam() == Order::after ? 59U : 60U);
}

TEST_P(SyncTest, ThePeriodIsTheTablesTick) {
  bench.poll();
  for (const std::uint32_t value : {1980U, 2000U, 2020U, 0U}) EXPECT_EQ(bench.write(0x1006, 0, value, 4), Abort::none);
  for (const std::uint32_t value : {1U, 500U, 1000U, 1979U})
    EXPECT_EQ(bench.write(0x1006, 0, value, 4), Abort::too_low);
  for (const std::uint32_t value : {2021U, 4000U, 10'000'000U})
    EXPECT_EQ(bench.write(0x1006, 0, value, 4), Abort::too_high);
  EXPECT_EQ(bench.read(0x1006), 0U);
}

// --- without a period ------------------------------------------------------------------------------------------------

// 0x1006 = 0: any rate will do, but not for ever.
TEST_P(SyncTest, WithoutAPeriodTheTorqueGoesAfterATime) {
  bench.poll();
  ASSERT_EQ(bench.write(0x1006, 0, 0, 4), Abort::none);
  EXPECT_EQ(bench.read(0x2014), 100U);
  run();
  for (int i = 0; i < 30; ++i) period(true, 0, 0, 50'000);
  EXPECT_EQ(new_stale(), 0U);
  const std::int32_t held = bench.node.torque(1);
  ASSERT_NE(held, 0);
  bench.pass(49'000);  // 50 ms were over
  EXPECT_EQ(bench.node.torque(1), held);
  EXPECT_EQ(new_stale(), 0U);
  bench.pass(1000);
  EXPECT_EQ(new_stale(), 1U);
  // however slow SYNC was: down at the tables' rate
  const std::int32_t ramp = (tables::page.parameters.constants[1].limits.tau_upper.raw + 49) / 50;
  for (std::int32_t before = held, i = 0; i < 52; ++i, before = bench.node.torque(1)) {
    bench.pass(2000);
    EXPECT_LE(std::abs(bench.node.torque(1) - before), ramp);
  }
  EXPECT_EQ(bench.node.torque(1), 0);
  EXPECT_TRUE(bench.node.errors().is_present(Error::setpoints_stale));
  EXPECT_FALSE(bench.on_wire.watchdog.bites());
}

TEST_P(SyncTest, ThatTimeIsAnObject) {
  bench.poll();
  EXPECT_EQ(bench.write(0x2014, 0, 0, 2), Abort::too_low);
  EXPECT_EQ(bench.write(0x2014, 0, 60'001, 2), Abort::too_high);
  ASSERT_EQ(bench.write(0x2014, 0, 5000, 2), Abort::none);
  ASSERT_EQ(bench.write(0x1006, 0, 0, 4), Abort::none);
  run();
  const std::int32_t held = bench.node.torque(1);
  bench.pass(4'990'000);
  EXPECT_EQ(bench.node.torque(1), held);
  bench.pass(200'000);
  EXPECT_EQ(bench.node.torque(1), 0);
}

INSTANTIATE_TEST_SUITE_P(Setpoints, SyncTest, ::testing::Values(Order::before, Order::after),
                         [](const auto& order) { return order.param == Order::before ? "before" : "after"; });

}  // namespace
}  // namespace fxdyn
