// What the drive node does when something is missing or wrong: docs/guide/node-behaviour.md.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <random>

#include "tests/firmware/node_bench.hpp"

namespace fxdyn {
namespace {

using canopen::Abort;
using canopen::NmtCommand;
using canopen::NmtState;
using dictionary::Counter;
using hal::fake::CanFault;
using test::Bench;
using test::Bytes;
using Codes = std::vector<std::uint16_t>;

std::int32_t torque_limit(std::size_t j) { return tables::page.parameters.constants[j].limits.tau_upper.raw; }
/// Torque limit / 50 ticks, rounded up.
std::int32_t default_ramp(std::size_t j) { return (torque_limit(j) + 49) / 50; }

class DriveNodeSafety : public ::testing::Test {
 protected:
  Bench<> bench;
  std::size_t k = 0;

  /// In operation, torques following the model's.
  void run() {
    bench.start();
    while (k < 100) bench.tick(test::motion(k++));
    for (const auto& torque : last = bench.tick(test::motion(k++))) ASSERT_EQ(torque.status, followed);
    bench.heard();
  }
  bool all_zero() const {
    for (std::size_t j = 0; j < 6; ++j) {
      if (bench.node.torque(j) != 0) return false;
    }
    return true;
  }
  std::array<std::int32_t, 6> torques() const {
    std::array<std::int32_t, 6> values{};
    for (std::size_t j = 0; j < 6; ++j) values[j] = bench.node.torque(j);
    return values;
  }
  static constexpr std::uint8_t followed = torque_status::fresh | torque_status::enabled;
  std::vector<WireTorque> last;
};

// --- stale setpoints -------------------------------------------------------------------------------------------------

TEST_F(DriveNodeSafety, BeginsWithARamp) {
  bench.start();
  auto before = torques();
  bool all_follow = false;
  std::size_t ticks = 0;
  while (!all_follow) {
    ASSERT_LT(++ticks, 51U);
    const auto sent = bench.tick(test::motion(k++));
    all_follow = true;
    for (std::size_t j = 0; j < 6; ++j) {
      EXPECT_LE(std::abs(bench.node.torque(j) - before[j]), default_ramp(j));
      all_follow = all_follow && (sent[j].status & torque_status::ramping) == 0;
    }
    before = torques();
  }
  EXPECT_GT(ticks, 5U);
}

TEST_F(DriveNodeSafety, ToleratesOneStaleTickAndRampsAfterThat) {
  run();
  const auto held = torques();
  bench.sync();
  for (const auto& torque : bench.torques()) EXPECT_EQ(torque.status, torque_status::enabled);
  EXPECT_EQ(torques(), held);
  bench.pass(2000);
  std::size_t ticks = 0;
  for (auto before = held; !all_zero(); before = torques()) {
    ASSERT_LE(++ticks, 50U);  // the configured time: 50 ticks for the whole limit
    const auto sent = bench.tick_without_setpoints();
    ASSERT_EQ(sent.size(), 6U);
    for (std::size_t j = 0; j < 6; ++j) {
      EXPECT_EQ(sent[j].status, torque_status::ramping | torque_status::enabled);
      const std::int32_t step = std::min(default_ramp(j), std::abs(before[j]));
      EXPECT_EQ(std::abs(bench.node.torque(j)), std::abs(before[j]) - step);
    }
  }
  EXPECT_GT(ticks, 5U);
  EXPECT_EQ(bench.counted(Counter::stale_ticks), ticks + 1);
  EXPECT_EQ(bench.counted(Counter::missing_setpoints), 6 * (ticks + 1));
  EXPECT_TRUE(bench.node.errors().is_present(Error::setpoints_stale));
  EXPECT_TRUE(bench.on_wire.fault.level);
}

TEST_F(DriveNodeSafety, RampAndToleranceAreObjects) {
  bench.poll();
  ASSERT_EQ(bench.write(0x2010, 0, 4, 2), Abort::none);
  ASSERT_EQ(bench.write(0x2012, 0, 3, 1), Abort::none);
  run();
  const auto held = torques();
  for (int i = 0; i < 3; ++i) {
    bench.tick_without_setpoints();
    EXPECT_EQ(torques(), held);
  }
  bench.tick_without_setpoints();
  for (std::size_t j = 0; j < 6; ++j)
    EXPECT_EQ(std::abs(torques()[j]), std::max(0, std::abs(held[j]) - (torque_limit(j) + 3) / 4));
  for (int i = 0; i < 3; ++i) bench.tick_without_setpoints();
  EXPECT_TRUE(all_zero());
}

// Any joint's setpoint missing: nothing of the others is used.
TEST_F(DriveNodeSafety, AllJointsOfATickOrNone) {
  for (std::size_t missing = 0; missing < 6; ++missing) {
    Bench<> one;
    one.start();
    for (k = 0; k < 60; ++k) one.tick(test::motion(k));
    std::array<std::int32_t, 6> before{};
    for (std::size_t j = 0; j < 6; ++j) before[j] = one.node.torque(j);
    const auto far = test::motion(k);
    for (std::size_t j = 0; j < 6; ++j) {
      if (j != missing) one.send_setpoint(j, far[j]);
    }
    one.sync();
    for (std::size_t j = 0; j < 6; ++j) {
      EXPECT_EQ(one.node.torque(j), before[j]);
      EXPECT_EQ(one.read(0x2100, static_cast<std::uint8_t>(j + 1)),
                static_cast<std::uint32_t>(test::motion(k - 1)[j].q));
    }
    EXPECT_EQ(one.counted(Counter::missing_setpoints), 1U);
    EXPECT_EQ(one.counted(Counter::stale_ticks), 1U);
  }
}

// What was not used does not wait for the next tick either.
TEST_F(DriveNodeSafety, SetpointsOfAStaleTickAreForgotten) {
  run();
  const auto setpoints = test::motion(k);
  for (std::size_t j = 0; j < 3; ++j) bench.send_setpoint(j, setpoints[j]);
  bench.sync();
  for (std::size_t j = 3; j < 6; ++j) bench.send_setpoint(j, setpoints[j]);
  bench.sync();
  EXPECT_EQ(bench.counted(Counter::stale_ticks), 2U);
  EXPECT_EQ(bench.counted(Counter::missing_setpoints), 6U);
}

TEST_F(DriveNodeSafety, ComesBackByTheRampAndFollowsBitForBit) {
  run();
  for (int i = 0; i < 6; ++i) bench.tick_without_setpoints();  // down, not to zero: effect states go on
  EXPECT_FALSE(all_zero());
  EXPECT_TRUE(bench.node.errors().is_present(Error::setpoints_stale));
  bool follows = false;
  for (int i = 0; !follows; ++i) {
    ASSERT_LT(i, 60);
    const auto before = torques();
    follows = true;
    for (std::size_t j = 0; const auto& torque : bench.tick(test::motion(k++))) {
      EXPECT_LE(std::abs(bench.node.torque(j) - before[j]), default_ramp(j));
      EXPECT_NE(torque.status & torque_status::fresh, 0);
      follows = follows && torque.status == followed;
      ++j;
    }
  }
  EXPECT_FALSE(bench.node.errors().any());
  EXPECT_FALSE(bench.on_wire.fault.level);
}

// After the torque has come to rest the effects begin anew: the node then computes what a fresh one does.
TEST_F(DriveNodeSafety, BeginsAnewAfterRest) {
  run();
  for (int i = 0; i < 52; ++i) bench.tick_without_setpoints();
  EXPECT_TRUE(all_zero());
  ASSERT_EQ(bench.write(0x2010, 0, 0, 2), Abort::none);
  bench.heard();
  test::Reference reference;
  for (std::size_t i = 1000; i < 1100; ++i) {  // elsewhere: no jump, since there is no last setpoint
    const auto setpoints = test::motion(i);
    bench.tick(setpoints);
    const auto expected = reference.tick(setpoints);
    for (std::size_t j = 0; j < 6; ++j) ASSERT_EQ(bench.node.torque(j), expected[static_cast<int>(j)].raw);
  }
}

// SYNC itself stays away: the node's own timer does the ticks, from one and a half periods on.
TEST_F(DriveNodeSafety, SyncThatStaysAwayRampsToZero) {
  run();  // ends 2 ms after the last SYNC
  const auto held = torques();
  bench.pass(500);
  EXPECT_EQ(bench.counted(Counter::stale_ticks), 0U);
  bench.pass(1000);
  EXPECT_EQ(bench.counted(Counter::stale_ticks), 1U);
  EXPECT_EQ(bench.torques().size(), 6U);  // told to whoever listens
  EXPECT_EQ(torques(), held);
  bench.pass(2 * 55 * 1000);
  EXPECT_TRUE(all_zero());
  const std::uint32_t ticks = bench.counted(Counter::overdue_syncs);
  EXPECT_EQ(ticks, 52U);  // one tolerated, 50 of the ramp, one that says so
  EXPECT_EQ(bench.counted(Counter::stale_ticks), ticks);
  EXPECT_EQ(bench.torques().size(), 6 * (ticks - 1));
  EXPECT_EQ(bench.counted(Counter::missing_setpoints), 0U);
  bench.pass(1'000'000);  // then it is quiet
  EXPECT_EQ(bench.counted(Counter::overdue_syncs), ticks);
  EXPECT_TRUE(bench.node.errors().is_present(Error::setpoints_stale));
  EXPECT_FALSE(bench.on_wire.watchdog.bites());
  while (!bench.tick(test::motion(k++)).empty() && bench.node.errors().any()) continue;
  EXPECT_FALSE(bench.node.errors().any());
}

// What may not go out does not wait for a SYNC that may never come.
TEST_F(DriveNodeSafety, WithoutSyncEnableAndHeartbeatRampToo) {
  for (const bool by_enable : {true, false}) {
    Bench<> one;
    one.poll();
    ASSERT_EQ(one.write(0x1006, 0, 0, 4), Abort::none);  // SYNC is not watched
    ASSERT_EQ(one.write(0x2014, 0, 60'000, 2), Abort::none);
    ASSERT_EQ(one.write(0x1016, 1, 0x007F'0032, 4), Abort::none);
    one.start();
    for (k = 0; k < 100; ++k) {
      one.send(0x77F, {0x05});
      one.tick(test::motion(k));
    }
    std::array<std::int32_t, 6> before{};
    for (std::size_t j = 0; j < 6; ++j) before[j] = one.node.torque(j);
    ASSERT_NE(before[1], 0);
    if (by_enable) one.on_wire.enable.level = false;
    for (int i = 0; i < 52 + 25; ++i) {  // the heartbeat counts as lost after 50 ms
      if (by_enable) one.send(0x77F, {0x05});
      one.pass(2000);
      for (std::size_t j = 0; j < 6; ++j) {
        EXPECT_LE(std::abs(one.node.torque(j) - before[j]), default_ramp(j)) << by_enable;
        before[j] = one.node.torque(j);
      }
    }
    for (std::size_t j = 0; j < 6; ++j) EXPECT_EQ(one.node.torque(j), 0) << by_enable;
    EXPECT_EQ(one.counted(Counter::stale_ticks), 0U);
  }
}

// Started again before the torque of the last operation has gone, and no SYNC comes: it goes on to zero.
TEST_F(DriveNodeSafety, StartedAgainWithoutSyncTheTorqueStillGoesToZero) {
  for (const NmtCommand command : {NmtCommand::stop, NmtCommand::reset_node}) {
    Bench<> one;
    one.start();
    for (k = 0; k < 60; ++k) one.tick(test::motion(k));
    one.nmt(command);
    one.pass(4000);
    EXPECT_NE(one.node.torque(1), 0);
    one.nmt(NmtCommand::start);
    ASSERT_EQ(one.node.state(), NmtState::operational);
    std::array<std::int32_t, 6> before{};
    for (std::size_t j = 0; j < 6; ++j) before[j] = one.node.torque(j);
    for (int i = 0; i < 51; ++i) {
      one.pass(2000);
      for (std::size_t j = 0; j < 6; ++j) {
        EXPECT_LE(std::abs(one.node.torque(j) - before[j]), default_ramp(j));
        before[j] = one.node.torque(j);
      }
    }
    for (std::size_t j = 0; j < 6; ++j) EXPECT_EQ(one.node.torque(j), 0);
  }
}

// --- setpoints of two ticks ------------------------------------------------------------------------------------------

// Joint 3's setpoint comes after its SYNC and the next one of it not at all: with 0x2013 that is noticed, whenever it
// happens, and a stream that is complete goes on undisturbed.
TEST_F(DriveNodeSafety, ParityTellsALateSetpointFromTheNextOne) {
  for (const bool parity : {true, false}) {
    Bench<> one;
    one.poll();
    ASSERT_EQ(one.write(0x2013, 0, parity ? 1 : 0, 1), Abort::none);
    one.start();
    const auto of = [](std::size_t tick) {
      auto setpoints = test::motion(tick);
      for (auto& setpoint : setpoints) setpoint.of_tick(tick % 2 != 0);
      return setpoints;
    };
    for (k = 0; k < 60; ++k) one.tick(of(k));
    EXPECT_EQ(one.counted(Counter::stale_ticks), 0U);
    for (std::size_t j = 0; j < 6; ++j) {
      if (j != 2) one.send_setpoint(j, of(k)[j]);
    }
    one.sync();
    one.send_setpoint(2, of(k)[2]);  // too late
    one.pass(2000);
    ++k;
    for (std::size_t j = 0; j < 6; ++j) {
      if (j != 2) one.send_setpoint(j, of(k)[j]);
    }
    one.sync();
    EXPECT_EQ(one.counted(Counter::mixed_setpoints), parity ? 1U : 0U);
    EXPECT_EQ(one.counted(Counter::stale_ticks), parity ? 2U : 1U);
    EXPECT_EQ(one.read(0x2100, 1), static_cast<std::uint32_t>(test::motion(parity ? 59 : k)[0].q));
    one.pass(2000);
    for (++k; k < 200; ++k) one.tick(of(k));
    EXPECT_EQ(one.counted(Counter::stale_ticks), parity ? 2U : 1U);
  }
}

// Half a step of ddq is what it costs.
TEST(WireSetpoint, ParityIsPartOfTheNumber) {
  for (const int ddq : {-32768, -32767, -3, -2, -1, 0, 1, 2, 32766, 32767}) {
    for (const bool odd : {false, true}) {
      WireSetpoint setpoint{1, 2, static_cast<std::int16_t>(ddq)};
      setpoint.of_tick(odd);
      EXPECT_EQ(setpoint.is_odd(), odd);
      EXPECT_LE(std::abs(setpoint.ddq - ddq), 1);
    }
  }
}

// --- setpoints that are wrong ----------------------------------------------------------------------------------------

TEST_F(DriveNodeSafety, DuplicatesAreCountedAndTheNewestWins) {
  run();
  auto old = test::motion(k);
  old[2].dq = 0;
  bench.send_setpoint(2, old[2]);
  const auto setpoints = test::motion(k);
  bench.tick(setpoints);
  EXPECT_EQ(bench.counted(Counter::duplicate_setpoints), 1U);
  EXPECT_EQ(bench.counted(Counter::stale_ticks), 0U);
  EXPECT_EQ(bench.read(0x2101, 3), static_cast<std::uint16_t>(setpoints[2].dq));
}

TEST_F(DriveNodeSafety, WrongLengthsAreNoSetpoints) {
  run();
  for (std::size_t size = 0; size < 8; ++size) {
    const auto setpoints = test::motion(k++);
    for (std::size_t j = 0; j < 6; ++j) {
      Bytes bytes = bench.bytes_of(setpoints[j]);
      if (j == size % 6) bytes.resize(size);
      bench.send(0x201 + static_cast<std::uint32_t>(j), bytes);
    }
    bench.sync();
    EXPECT_EQ(bench.counted(Counter::malformed_setpoints), 2 * size + 1);
    EXPECT_EQ(bench.counted(Counter::stale_ticks), size + 1);
    auto remote = bench.frame(0x203, bench.bytes_of(setpoints[2]));
    remote.remote = true;
    bench.send(remote);
    bench.pass(2000);
    bench.tick(test::motion(k++));
  }
  EXPECT_TRUE(bench.node.errors().is_present(Error::pdo_length));
  bench.pass(200'000);
  EXPECT_FALSE(bench.node.errors().is_present(Error::pdo_length));
}

TEST_F(DriveNodeSafety, JumpsAreImplausible) {
  run();
  for (std::size_t j = 0; j < 6; ++j) {
    const auto& limits = tables::page.parameters.constants[j].limits;
    // 2 * velocity limit * 2 ms in the position's format, which is 8 times finer
    const auto most = static_cast<std::int64_t>(2.0 * limits.dq_upper.raw * 8 / 500);
    for (const int sign : {1, -1}) {
      const auto before = torques();
      auto setpoints = test::motion(k - 1);
      setpoints[j].q = static_cast<std::int32_t>(setpoints[j].q + sign * (most + 3));
      bench.tick(setpoints);
      EXPECT_EQ(torques(), before) << "joint " << j + 1;
      setpoints = test::motion(k - 1);
      setpoints[j].q = static_cast<std::int32_t>(setpoints[j].q + sign * (most - 3));
      EXPECT_NE(bench.tick(setpoints)[j].status & torque_status::fresh, 0) << "joint " << j + 1;
      bench.tick(test::motion(k - 1));
    }
  }
  EXPECT_EQ(bench.counted(Counter::implausible_setpoints), 12U);
  EXPECT_EQ(bench.counted(Counter::stale_ticks), 12U);
}

// A gap in which the robot moved on is no jump.
TEST_F(DriveNodeSafety, TheAllowedJumpGrowsWithTheGap) {
  run();
  for (int i = 0; i < 5; ++i) {
    bench.tick_without_setpoints();
    ++k;
  }
  bench.tick(test::motion(k++));
  EXPECT_EQ(bench.counted(Counter::implausible_setpoints), 0U);
  EXPECT_EQ(bench.counted(Counter::stale_ticks), 5U);
}

TEST_F(DriveNodeSafety, SetpointsBeyondTheLimitsAreClampedAndCounted) {
  run();
  // creep to a position far outside, each step plausible
  auto setpoints = test::motion(k);
  for (int i = 0; i < 1000; ++i) {
    setpoints[1].q += 1'500'000;
    bench.tick(setpoints);
  }
  EXPECT_GT(setpoints[1].q, tables::page.parameters.constants[1].limits.q_upper.raw);
  EXPECT_GT(bench.counted(Counter::saturations), 0U);
  EXPECT_EQ(bench.counted(Counter::stale_ticks), 0U);
  for (std::size_t j = 0; j < 6; ++j) EXPECT_LE(std::abs(bench.node.torque(j)), torque_limit(j));
}

TEST_F(DriveNodeSafety, TheLimitOfATorqueStepIsAnObject) {
  run();
  constexpr std::int32_t most = 100;  // mN*m
  for (std::uint8_t j = 1; j <= 6; ++j) ASSERT_EQ(bench.write(0x2011, j, most, 4), Abort::none);
  bool limited = false;
  for (int i = 0; i < 100; ++i) {
    const auto before = torques();
    const auto sent = bench.tick(test::motion(k));
    k += 2;  // twice as fast
    for (std::size_t j = 0; j < 6; ++j) {
      EXPECT_LE(std::abs(bench.node.torque(j) - before[j]), most * (1 << 22) / 1000);
      limited = limited || (sent[j].status & torque_status::step_limited) != 0;
    }
  }
  EXPECT_TRUE(limited);
  EXPECT_GT(bench.counted(Counter::limited_steps), 0U);
}

// --- enable, fault, watchdog -----------------------------------------------------------------------------------------

TEST_F(DriveNodeSafety, EnableLowRampsToZeroAndIsNoFault) {
  run();
  bench.on_wire.enable.level = false;
  std::size_t ticks = 0;
  while (!all_zero()) {
    ASSERT_LT(++ticks, 51U);
    const auto before = torques();
    for (const auto& torque : bench.tick(test::motion(k++)))
      EXPECT_EQ(torque.status, torque_status::fresh | torque_status::ramping);
    for (std::size_t j = 0; j < 6; ++j) EXPECT_LE(std::abs(bench.node.torque(j) - before[j]), default_ramp(j));
  }
  bench.pass(1000);
  EXPECT_FALSE(bench.node.errors().any());
  EXPECT_FALSE(bench.on_wire.fault.level);
  bench.on_wire.enable.level = true;
  bench.tick(test::motion(k++));
  EXPECT_FALSE(all_zero());
}

TEST_F(DriveNodeSafety, AnEnableThatCanNotBeReadIsLow) {
  run();
  bench.on_wire.enable.broken = true;
  for (int i = 0; i < 51; ++i) bench.tick(test::motion(k++));
  EXPECT_TRUE(all_zero());
}

TEST_F(DriveNodeSafety, TheFaultOutputIsSetUntilItTakes) {
  run();
  bench.on_wire.fault.broken = true;
  for (int i = 0; i < 3; ++i) bench.tick_without_setpoints();
  EXPECT_FALSE(bench.on_wire.fault.level);
  bench.on_wire.fault.broken = false;
  bench.poll();
  EXPECT_TRUE(bench.on_wire.fault.level);
}

TEST_F(DriveNodeSafety, TheWatchdogIsFedByTicksThatEnded) {
  run();
  const std::uint32_t feeds = bench.on_wire.watchdog.feeds;
  for (int i = 0; i < 100; ++i) bench.node.poll();  // alive, but no tick
  EXPECT_EQ(bench.on_wire.watchdog.feeds, feeds);
  bench.tick(test::motion(k++));
  EXPECT_EQ(bench.on_wire.watchdog.feeds, feeds + 1);
  EXPECT_FALSE(bench.on_wire.watchdog.bites());
  // A tick that hangs never comes back, and nobody feeds.
  bench.clock.advance(bench.on_wire.watchdog_us + 2000);
  EXPECT_TRUE(bench.on_wire.watchdog.bites());
}

TEST(DriveNodeStart, TellsThatTheWatchdogBit) {
  Bench<> bench({.board = "bench", .watchdog_reset = true});
  bench.pass(1000);
  EXPECT_EQ(bench.emergencies(), (Codes{0x6010}));
  EXPECT_EQ(bench.counted(Counter::watchdog_resets), 1U);
  EXPECT_TRUE(bench.on_wire.fault.level);
  bench.pass(200'000);
  EXPECT_EQ(bench.emergencies(), (Codes{0x0000}));
  EXPECT_FALSE(bench.on_wire.fault.level);
}

TEST(DriveNodeStart, CorruptTablesKeepItPreOperational) {
  Bench<> bench({.board = "bench"}, false);
  bench.pass(1000);
  EXPECT_EQ(bench.emergencies(), (Codes{0x6320}));
  EXPECT_TRUE(bench.on_wire.fault.level);
  bench.nmt(NmtCommand::start);
  EXPECT_EQ(bench.node.state(), NmtState::pre_operational);
  EXPECT_TRUE(bench.tick(test::motion(0)).empty());
  bench.pass(20'000);
  EXPECT_EQ(bench.emergencies(), (Codes{0x6320}));  // why it does not start
  EXPECT_EQ(bench.read(0x2000, 3), 0U);
  EXPECT_EQ(bench.read(0x1001), 1U);
  bench.nmt(NmtCommand::reset_node);
  bench.nmt(NmtCommand::start);
  EXPECT_EQ(bench.node.state(), NmtState::pre_operational);
  EXPECT_TRUE(bench.on_wire.fault.level);
}

// A page in the slot for updates that can't be used is told once; the node runs on its own tables.
TEST(DriveNodeStart, ARefusedUpdateIsToldAndIsNoFaultForEver) {
  for (unsigned slot = 0; slot <= static_cast<unsigned>(UpdateSlot::unreadable); ++slot) {
    SCOPED_TRACE(slot);
    const auto update = static_cast<UpdateSlot>(slot);
    const bool refused = update != UpdateSlot::empty && update != UpdateSlot::used && update != UpdateSlot::same;
    Bench<> bench({.board = "bench"}, true, tables::page.parameters, update);
    bench.pass(1000);
    const auto told = bench.heard(0x081);
    ASSERT_EQ(told.size(), refused ? 1U : 0U);
    if (refused) {
      EXPECT_EQ(canopen::load<2>(&told[0][0]), 0x6320U);
      EXPECT_EQ(canopen::load<2>(&told[0][3]), slot) << "0 would be: the tables are not valid";
    }
    EXPECT_EQ(bench.on_wire.fault.level, refused);
    EXPECT_EQ(bench.read(0x2000, 6), update == UpdateSlot::used ? 1U : 0U);
    EXPECT_EQ(bench.read(0x2000, 7), 5U);
    EXPECT_EQ(bench.read(0x2000, 8), slot);
    bench.nmt(NmtCommand::start);
    EXPECT_EQ(bench.node.state(), NmtState::operational);
    EXPECT_EQ(bench.tick(test::motion(0)).size(), test::robot_joints);
    bench.nmt(NmtCommand::enter_pre_operational);  // or missing setpoints are an error soon
    bench.pass(ErrorLog::event_us + 20'000);
    EXPECT_FALSE(bench.on_wire.fault.level);
    EXPECT_EQ(bench.read(0x1001), 0U);
  }
}

TEST(DriveNodeStart, CorruptTablesAndARefusedUpdateAreTwoErrors) {
  Bench<> bench({.board = "bench"}, false, tables::page.parameters, UpdateSlot::unreadable);
  bench.pass(20'000);
  const auto told = bench.heard(0x081);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(canopen::load<2>(&told[0][3]), 0U);
  EXPECT_EQ(canopen::load<2>(&told[1][3]), static_cast<std::uint32_t>(UpdateSlot::unreadable));
  bench.pass(ErrorLog::event_us);
  EXPECT_TRUE(bench.on_wire.fault.level);
}

// The page itself, as the flash holds it: any bit that is wrong is noticed.
TEST(DriveNodeStart, AnyFlippedBitOfThePageIsNoticed) {
  auto page = tables::page;
  ASSERT_TRUE(page_is_valid(page));
  auto* bytes = reinterpret_cast<std::uint8_t*>(&page);  // NOLINT: as a flash fails
  std::mt19937 random(1);
  for (int i = 0; i < 200; ++i) {
    const std::size_t at = random() % sizeof page;
    const auto bit = static_cast<std::uint8_t>(1U << random() % 8);
    bytes[at] ^= bit;
    EXPECT_FALSE(page_is_valid(page)) << "byte " << at;
    bytes[at] ^= bit;
  }
  EXPECT_TRUE(page_is_valid(page));
}

// --- emergencies -----------------------------------------------------------------------------------------------------

TEST_F(DriveNodeSafety, EmergencyTellsStaleSetpointsAndThatTheyAreBack) {
  run();
  bench.pass(20'000 - 2000);
  bench.heard();
  for (int i = 0; i < 10; ++i) bench.tick_without_setpoints();
  bench.pass(20'000);
  bool seen = false;
  for (const auto& frame : bench.wire.sent) {
    if (frame.id != 0x081) continue;
    seen = true;
    EXPECT_EQ(frame.size, 8);
    EXPECT_EQ(canopen::load<2>(frame.data.data()), 0x8250U);
    EXPECT_EQ(frame.data[2], 0x11);
  }
  EXPECT_TRUE(seen);
  EXPECT_EQ(bench.read(0x1003, 0), 1U);
  EXPECT_EQ(bench.read(0x1003, 1) & 0xFFFF, 0x8250U);
  EXPECT_EQ(bench.read(0x1001), 0x11U);
  bench.wire.sent.clear();
  for (int i = 0; i < 60; ++i) bench.tick(test::motion(k++));
  Codes codes;
  for (const auto& frame : bench.wire.sent) {
    if (frame.id == 0x081) codes.push_back(static_cast<std::uint16_t>(canopen::load<2>(frame.data.data())));
  }
  EXPECT_EQ(codes, (Codes{0x0000}));
  EXPECT_EQ(bench.read(0x1001), 0U);
  EXPECT_EQ(bench.write(0x1003, 0, 0, 1), Abort::none);
  EXPECT_EQ(bench.read(0x1003, 0), 0U);
}

TEST_F(DriveNodeSafety, EmergenciesKeepTheirInhibitTime) {
  bench.poll();
  ASSERT_EQ(bench.write(0x1015, 0, 300, 2), Abort::none);  // 30 ms
  run();
  bench.heard();
  std::vector<std::uint64_t> times;
  for (int i = 0; i < 500; ++i) {
    if (i % 10 < 5)
      bench.tick_without_setpoints();
    else
      bench.tick(test::motion(k++));
    bench.send(canopen::sync_id, {0x00});  // another error
    for (const auto& frame : bench.wire.sent) {
      if (frame.id == 0x081) times.push_back(bench.clock.elapsed_us());
    }
    bench.wire.sent.clear();
  }
  ASSERT_GT(times.size(), 5U);
  for (std::size_t i = 1; i < times.size(); ++i) EXPECT_GE(times[i] - times[i - 1], 28'000U);  // seen once a tick
}

TEST_F(DriveNodeSafety, SyncWithDataIsNoSync) {
  run();
  bench.send(canopen::sync_id, {0x01});
  bench.poll();
  EXPECT_TRUE(bench.torques().empty());
  EXPECT_TRUE(bench.node.errors().is_present(Error::sync_length));
  EXPECT_EQ(bench.counted(Counter::malformed_frames), 1U);
}

// --- heartbeat of the host -------------------------------------------------------------------------------------------

TEST_F(DriveNodeSafety, ALostHeartbeatRampsToZero) {
  bench.poll();
  ASSERT_EQ(bench.write(0x1016, 1, 0x7F << 16 | 50, 4), Abort::none);  // node 127, 50 ms
  run();                                                               // watched from the first heartbeat on
  EXPECT_FALSE(bench.node.errors().any());
  const auto beat = [&] { bench.send(0x77F, {0x05}); };
  for (int i = 0; i < 50; ++i) {
    if (i % 20 == 0) beat();
    bench.tick(test::motion(k++));
  }
  EXPECT_FALSE(bench.node.errors().any());
  std::size_t ticks = 0;
  while (!all_zero()) {
    ASSERT_LT(++ticks, 90U);
    const auto before = torques();
    bench.tick(test::motion(k++));
    if (bench.node.errors().any()) {
      for (std::size_t j = 0; j < 6; ++j) EXPECT_LE(std::abs(bench.node.torque(j) - before[j]), default_ramp(j));
    }
  }
  EXPECT_EQ(bench.counted(Counter::lost_heartbeats), 1U);
  EXPECT_TRUE(bench.node.errors().is_present(Error::heartbeat_lost));
  EXPECT_EQ(bench.node.state(), NmtState::operational);
  beat();
  bench.tick(test::motion(k++));
  EXPECT_FALSE(bench.node.errors().any());
  EXPECT_FALSE(all_zero());
}

TEST_F(DriveNodeSafety, ErrorBehaviourIsAnObject) {
  const NmtState expected[] = {NmtState::pre_operational, NmtState::operational, NmtState::stopped};
  for (std::uint32_t behaviour = 0; behaviour < 3; ++behaviour) {
    Bench<> one;
    one.poll();
    ASSERT_EQ(one.write(0x1029, 1, behaviour, 1), Abort::none);
    ASSERT_EQ(one.write(0x1016, 2, 0x10 << 16 | 20, 4), Abort::none);
    one.start();
    for (k = 0; k < 60; ++k) one.tick(test::motion(k));
    one.send(0x710, {0x05});
    one.pass(30'000);
    EXPECT_EQ(one.node.state(), expected[behaviour]);
    one.pass(200'000);
    for (std::size_t j = 0; j < 6; ++j) EXPECT_EQ(one.node.torque(j), 0);
  }
}

// --- leaving operation -----------------------------------------------------------------------------------------------

// Not even a reset makes a step: what is left of the torque goes to zero by the node's own timer.
TEST_F(DriveNodeSafety, LeavingOperationRamps) {
  for (const NmtCommand command :
       {NmtCommand::stop, NmtCommand::enter_pre_operational, NmtCommand::reset_node, NmtCommand::reset_communication}) {
    Bench<> one;
    one.start();
    for (k = 0; k < 60; ++k) one.tick(test::motion(k));
    one.nmt(command);
    one.heard();
    std::array<std::int32_t, 6> before{};
    for (std::size_t j = 0; j < 6; ++j) before[j] = one.node.torque(j);
    for (int i = 0; i < 51; ++i) {
      one.pass(2000);
      for (std::size_t j = 0; j < 6; ++j) {
        EXPECT_LE(std::abs(one.node.torque(j) - before[j]), default_ramp(j));
        before[j] = one.node.torque(j);
      }
    }
    for (std::size_t j = 0; j < 6; ++j) EXPECT_EQ(one.node.torque(j), 0);
    EXPECT_TRUE(one.torques().empty());
    EXPECT_FALSE(one.on_wire.watchdog.bites());
  }
}

// --- the bus ---------------------------------------------------------------------------------------------------------

TEST_F(DriveNodeSafety, ComesBackFromBusOff) {
  run();
  bench.on_wire.bus.fall_off_the_bus(20);
  bench.wire.sent.clear();
  std::array<std::int32_t, 6> before = torques();
  for (int i = 0; i < 8; ++i) {
    bench.pass(1000);
    for (std::size_t j = 0; j < 6; ++j) EXPECT_LE(std::abs(bench.node.torque(j) - before[j]), default_ramp(j));
    before = torques();
  }
  EXPECT_TRUE(bench.wire.sent.empty());
  EXPECT_EQ(bench.counted(Counter::bus_offs), 1U);
  bench.pass(20'000);
  EXPECT_EQ(bench.on_wire.bus.errors().state, hal::CanState::active);
  Codes codes;
  for (const auto& frame : bench.wire.sent) {
    if (frame.id == 0x081) codes.push_back(static_cast<std::uint16_t>(canopen::load<2>(frame.data.data())));
  }
  EXPECT_NE(std::find(codes.begin(), codes.end(), 0x8140), codes.end());
  EXPECT_EQ(bench.node.state(), NmtState::operational);
  for (int i = 0; i < 120; ++i) bench.tick(test::motion(k++));
  EXPECT_FALSE(bench.node.errors().any());
  EXPECT_FALSE(bench.on_wire.watchdog.bites());
}

TEST_F(DriveNodeSafety, TellsErrorPassiveAndOverrun) {
  run();
  bench.on_wire.bus.set_passive(true);
  bench.tick(test::motion(k++));
  EXPECT_TRUE(bench.node.errors().is_present(Error::error_passive));
  bench.on_wire.bus.set_passive(false);
  bench.tick(test::motion(k++));
  EXPECT_FALSE(bench.node.errors().is_present(Error::error_passive));
  bench.on_wire.bus.capacity = 4;
  bench.tick(test::motion(k++));
  EXPECT_EQ(bench.counted(Counter::lost_received), 3U);  // two setpoints and SYNC
  EXPECT_TRUE(bench.node.errors().is_present(Error::overrun));
}

TEST_F(DriveNodeSafety, AFloodOfForeignFramesStarvesNothing) {
  run();
  bench.on_wire.bus.capacity = 100'000;
  for (int i = 0; i < 20; ++i) {
    for (std::uint32_t id = 0x300; id < 0x400; ++id) bench.send(id, {1, 2, 3});
    auto extended = bench.frame(0x201, {1, 2, 3, 4, 5, 6, 7, 8});
    extended.extended = true;
    bench.send(extended);
    const auto sent = bench.tick(test::motion(k++));
    ASSERT_EQ(sent.size(), 6U);
    EXPECT_EQ(sent[0].status, followed);
  }
  EXPECT_EQ(bench.counted(Counter::foreign_frames), 20U * 257U);
  // With frames that never end it still looks after its heartbeat.
  bench.heard();
  for (int i = 0; i < 300; ++i) {
    for (int n = 0; n < 100; ++n) bench.send(0x333, {});
    bench.clock.advance(1000);
    EXPECT_TRUE(bench.node.poll());
  }
  EXPECT_GE(bench.heard(0x701).size(), 2U);
}

// --- two nodes with one id -------------------------------------------------------------------------------------------

TEST_F(DriveNodeSafety, TwoNodesWithOneIdBothLeaveOperation) {
  test::NodeOnWire<hal::ClassicFrame, test::Robot> twin(bench.wire, bench.clock, tables::page.parameters);
  bench.poll();
  while (twin.node.poll()) continue;
  bench.nmt(NmtCommand::start);
  while (twin.node.poll()) continue;
  for (int i = 0; i < 200; ++i) {  // heartbeats
    bench.pass(1000);
    while (twin.node.poll()) continue;
  }
  EXPECT_EQ(bench.node.state(), NmtState::pre_operational);
  EXPECT_EQ(twin.node.state(), NmtState::pre_operational);
  EXPECT_GT(bench.counted(Counter::id_collisions), 0U);
  EXPECT_GT(twin.node.counted(Counter::id_collisions), 0U);
}

TEST_F(DriveNodeSafety, ForeignFramesUnderOwnIdentifiersAreCollisions) {
  for (const std::uint32_t id : {0x701U, 0x081U, 0x581U, 0x181U, 0x186U}) {
    Bench<> one;
    one.start();
    for (k = 0; k < 60; ++k) one.tick(test::motion(k));
    one.send(id, {0x05});
    one.poll();
    EXPECT_EQ(one.node.state(), NmtState::pre_operational);
    EXPECT_EQ(one.counted(Counter::id_collisions), 1U);
    EXPECT_EQ(one.emergencies(), (Codes{0x8150}));
    one.pass(200'000);
    EXPECT_EQ(one.emergencies(), (Codes{0x0000}));
    one.nmt(NmtCommand::start);
    EXPECT_EQ(one.node.state(), NmtState::operational);
  }
}

// --- faults at random ------------------------------------------------------------------------------------------------

// Whatever the bus does to the frames: no crash, no torque step larger than the steps that were configured, never a
// torque beyond its limit, and afterwards all is as before.
RC_GTEST_PROP(DriveNodeFaults, NoStepIsLargerThanConfigured, ()) {
  const auto ramp_ticks = *rc::gen::inRange<std::uint32_t>(5, 100);
  const auto step = *rc::gen::inRange<std::uint32_t>(300, 20'000);  // mN*m
  const auto one_in = *rc::gen::inRange<std::uint32_t>(3, 60);
  const auto seed = *rc::gen::arbitrary<std::uint32_t>();
  Bench<> bench;
  bench.poll();
  RC_ASSERT(bench.write(0x2010, 0, ramp_ticks, 2) == Abort::none);
  std::array<std::int32_t, 6> most{}, ramp{};
  for (std::size_t j = 0; j < 6; ++j) {
    RC_ASSERT(bench.write(0x2011, static_cast<std::uint8_t>(j + 1), step, 4) == Abort::none);
    most[j] = static_cast<std::int32_t>((std::uint64_t{step} << 22) / 1000);
    ramp[j] = static_cast<std::int32_t>((torque_limit(j) + static_cast<std::int32_t>(ramp_ticks) - 1) /
                                        static_cast<std::int32_t>(ramp_ticks));
  }
  bench.start();
  std::mt19937 random(seed);
  bench.wire.random.seed(seed);
  bench.wire.fault = [&](const hal::ClassicFrame&) {
    return random() % one_in == 0 ? static_cast<CanFault>(1 + random() % 6) : CanFault::none;
  };

  std::array<std::int32_t, 6> before{};
  std::size_t steps_of_ticks = 0;
  bool was_operational = true;
  const auto check = [&] {
    // Each node tick moves a torque once; at most two fall into a stretch of 2 ms.
    const std::uint32_t ticks = bench.counted(Counter::ticks) + bench.counted(Counter::stale_ticks);
    // A flipped bit makes a reset of 0x80, and that brings the defaults back.
    if (bench.counted(Counter::nmt_resets) != 0) {
      for (std::size_t j = 0; j < 6; ++j) {
        most[j] = torque_limit(j);
        ramp[j] = std::max(ramp[j], default_ramp(j));
      }
    }
    // Where the torque may not go out, the node's own timer moves it between ticks too.
    const bool operational = bench.node.state() == NmtState::operational;
    const std::size_t own = !operational || !was_operational || !bench.on_wire.enable.level ? 1 : 0;
    was_operational = operational;
    const auto moves = static_cast<std::int64_t>(std::max<std::size_t>(ticks - steps_of_ticks + own, 1));
    for (std::size_t j = 0; j < 6; ++j) {
      const std::int64_t change = std::abs(std::int64_t{bench.node.torque(j)} - before[j]);
      RC_ASSERT(change <= moves * most[j]);
      if ((bench.node.errors().is_present(Error::setpoints_stale))) RC_ASSERT(change <= moves * ramp[j]);
      RC_ASSERT(std::abs(bench.node.torque(j)) <= torque_limit(j));
      before[j] = bench.node.torque(j);
    }
    steps_of_ticks = ticks;
  };
  for (std::size_t k = 0; k < 300; ++k) {
    bench.send_setpoints(test::motion(k));
    if (random() % 200 == 0) bench.on_wire.bus.fall_off_the_bus(static_cast<int>(random() % 30));
    if (random() % 100 == 0) bench.on_wire.enable.level = !bench.on_wire.enable.level;
    if (random() % 100 == 0) bench.on_wire.bus.busy = 20;
    if (random() % 200 == 0) bench.send(0, {0x80, 0x00});
    if (random() % 50 == 0) bench.send(0x601, {0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0});
    bench.send(canopen::sync_id, {});
    bench.poll();
    check();
    for (int i = 0; i < 4; ++i) {
      bench.pass(500);
      check();
    }
    bench.heard();
    if (bench.node.state() != NmtState::operational) bench.send(0, {0x01, 0x00});
  }

  bench.wire.fault = nullptr;
  bench.on_wire.enable.level = true;
  bench.pass(500'000);
  bench.nmt(NmtCommand::start);
  bench.heard();
  std::vector<WireTorque> sent;
  for (std::size_t k = 300; k < 1000; ++k) sent = bench.tick(test::motion(k));
  RC_ASSERT(sent.size() == 6U);
  RC_ASSERT(!bench.node.errors().any());
  for (const auto& torque : sent) RC_ASSERT((torque.status & torque_status::ramping) == 0);
  RC_ASSERT(!bench.on_wire.watchdog.bites());
}

// Each kind of fault alone, on setpoints alone: the node counts exactly what was done to it.
class CountedFaults : public ::testing::TestWithParam<CanFault> {};

TEST_P(CountedFaults, InjectorAndNodeAgree) {
  Bench<> bench;
  bench.start();
  std::mt19937 random(7);
  std::uint32_t injected = 0, twice_in_a_row = 0;
  std::size_t k = 0;
  std::array<std::size_t, 6> last{};
  bench.wire.fault = [&](const hal::ClassicFrame& frame) {
    if (frame.id <= 0x200 || frame.id > 0x206 || random() % 20 != 0) return CanFault::none;
    ++injected;
    auto& before = last[frame.id - 0x201];
    twice_in_a_row += before + 1 == k ? 1 : 0;
    before = k;
    return GetParam();
  };
  for (k = 2; k < 5000; ++k) bench.tick(test::motion(k));
  bench.wire.fault = nullptr;
  bench.tick(test::motion(k));
  EXPECT_GT(injected, 1000U);
  const auto counted = [&](Counter counter) { return bench.counted(counter); };
  switch (GetParam()) {
    case CanFault::drop:
      EXPECT_EQ(counted(Counter::missing_setpoints), injected);
      break;
    case CanFault::duplicate:
      EXPECT_EQ(counted(Counter::duplicate_setpoints), injected);
      EXPECT_EQ(counted(Counter::stale_ticks), 0U);
      break;
    case CanFault::truncate:
      EXPECT_EQ(counted(Counter::malformed_setpoints), injected);
      EXPECT_EQ(counted(Counter::missing_setpoints), injected);
      break;
    case CanFault::delay:  // missing in its tick; in the next one too many, or in place of one that is late itself
      EXPECT_EQ(counted(Counter::missing_setpoints), injected - twice_in_a_row);
      EXPECT_EQ(counted(Counter::duplicate_setpoints), injected - twice_in_a_row);
      break;
    default:
      break;
  }
}
INSTANTIATE_TEST_SUITE_P(Each, CountedFaults,
                         ::testing::Values(CanFault::drop, CanFault::duplicate, CanFault::truncate, CanFault::delay));

}  // namespace
}  // namespace fxdyn
