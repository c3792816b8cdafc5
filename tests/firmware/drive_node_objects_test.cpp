// Objects of the drive node that masters write, at the edges of what CiA 301 allows; and what a review's mutants lived
// on.

#include <gtest/gtest.h>

#include "tests/firmware/node_bench.hpp"

namespace fxdyn {
namespace {

using canopen::Abort;
using canopen::NmtState;
using dictionary::Counter;
using test::Bench;
using test::Bytes;

class DriveNodeObjects : public ::testing::Test {
 protected:
  Bench<> bench;
  std::size_t k = 0;
  void run() {
    bench.start();
    while (k < 100) bench.tick(test::motion(k++));
    bench.heard();
  }
  bool all_zero() const {
    for (std::size_t j = 0; j < 6; ++j) {
      if (bench.node.torque(j) != 0) return false;
    }
    return true;
  }
};

// --- identifiers -----------------------------------------------------------------------------------------------------

// Own RPDO, TPDO, EMCY, and what belongs to SDO, NMT and heartbeats.
TEST_F(DriveNodeObjects, SyncTakesNoIdentifierThatIsInUse) {
  bench.poll();
  for (const std::uint32_t id : {0x000U, 0x07FU, 0x081U, 0x181U, 0x186U, 0x201U, 0x206U, 0x580U, 0x581U, 0x5FFU, 0x600U,
                                 0x601U, 0x67FU, 0x6E0U, 0x6FFU, 0x700U, 0x701U, 0x7FFU, 0x800U})
    EXPECT_EQ(bench.write(0x1005, 0, id, 4), Abort::invalid_value) << std::hex << id;
  for (const std::uint32_t id : {0x090U, 0x100U, 0x187U, 0x207U, 0x57FU, 0x680U, 0x6DFU, 0x080U})
    EXPECT_EQ(bench.write(0x1005, 0, id, 4), Abort::none) << std::hex << id;
}

TEST_F(DriveNodeObjects, PdosTakeNoIdentifierThatIsInUse) {
  bench.poll();
  for (const std::uint16_t index : {std::uint16_t{0x1400}, std::uint16_t{0x1800}}) {
    const std::uint32_t own = index == 0x1400 ? 0x201U : 0x181U;
    ASSERT_EQ(bench.write(index, 1, canopen::cob_invalid | own, 4), Abort::none);
    for (const std::uint32_t id : {0x080U, 0x081U, 0x182U, 0x202U, 0x600U, 0x601U, 0x6E0U, 0x701U})
      EXPECT_EQ(bench.write(index, 1, id, 4), Abort::invalid_value) << std::hex << id;
    for (const std::uint32_t id : {0x082U, 0x6DFU}) {
      EXPECT_EQ(bench.write(index, 1, id, 4), Abort::none) << std::hex << id;
      EXPECT_EQ(bench.write(index, 1, canopen::cob_invalid | id, 4), Abort::none);
    }
    ASSERT_EQ(bench.write(index, 1, own, 4), Abort::none);
  }
}

// Bit 30 says "no remote frames" of a TPDO and nothing of an RPDO.
TEST_F(DriveNodeObjects, Bit30OfAnRpdoDoesNotCount) {
  bench.poll();
  EXPECT_EQ(bench.write(0x1400, 1, 0xC000'0201, 4), Abort::none);
  EXPECT_EQ(bench.read(0x1400, 1), 0x8000'0201U);
  EXPECT_EQ(bench.write(0x1400, 1, 0x4000'0301, 4), Abort::none);
  EXPECT_EQ(bench.read(0x1400, 1), 0x301U);
}

// --- consumer heartbeat ----------------------------------------------------------------------------------------------

TEST_F(DriveNodeObjects, ConsumersAreCheckedAsCia301Says) {
  bench.poll();
  EXPECT_EQ(bench.write(0x1016, 1, 5U << 16 | 100, 4), Abort::none);
  EXPECT_EQ(bench.write(0x1016, 2, 5U << 16 | 200, 4), Abort::incompatible);
  EXPECT_EQ(bench.read(0x1016, 2), 0U);
  EXPECT_EQ(bench.write(0x1016, 2, 5U << 16, 4), Abort::none);        // without a time it is not used
  EXPECT_EQ(bench.write(0x1016, 1, 5U << 16 | 300, 4), Abort::none);  // its own place
  EXPECT_EQ(bench.write(0x1016, 1, 0x0100'0000U | 5U << 16 | 100, 4), Abort::invalid_value);
}

// The second of two places: a loss there ends when the place is given away, and the first place's does not.
TEST_F(DriveNodeObjects, ALossEndsWithItsOwnPlace) {
  bench.poll();
  ASSERT_EQ(bench.write(0x1016, 1, 0x7FU << 16 | 60'000, 4), Abort::none);
  ASSERT_EQ(bench.write(0x1016, 2, 0x7EU << 16 | 50, 4), Abort::none);
  bench.send(0x77F, {0x05});
  bench.send(0x77E, {0x05});
  bench.pass(60'000);
  ASSERT_TRUE(bench.node.errors().is_present(Error::heartbeat_lost));
  EXPECT_EQ(bench.write(0x1016, 1, 0x7FU << 16 | 50'000, 4), Abort::none);
  EXPECT_TRUE(bench.node.errors().is_present(Error::heartbeat_lost)) << "of the other place";
  EXPECT_EQ(bench.write(0x1016, 2, 0, 4), Abort::none);
  EXPECT_FALSE(bench.node.errors().is_present(Error::heartbeat_lost));
}

// Nothing was asked for yet: an abort names no object.
TEST_F(DriveNodeObjects, ASegmentBeforeAnyRequestNamesNoObject) {
  bench.poll();
  const test::Bytes answer = bench.request({0x60, 0, 0, 0, 0, 0, 0, 0});
  ASSERT_EQ(answer.size(), 8U);
  EXPECT_EQ(answer[0], 0x80);
  EXPECT_EQ(test::Bytes(answer.begin() + 1, answer.begin() + 4), (test::Bytes{0, 0, 0}));
}

TEST_F(DriveNodeObjects, ANodeAbove127IsNotWatched) {
  bench.poll();
  ASSERT_EQ(bench.write(0x1016, 1, 0x85U << 16 | 50, 4), Abort::none);
  bench.send(0x705, {0x05});
  bench.poll();
  bench.pass(100'000);
  EXPECT_FALSE(bench.node.errors().any());
}

// What the master says of itself: it begins anew, or it has stopped.
TEST_F(DriveNodeObjects, ABootUpOrAStopOfTheMasterIsALostHeartbeat) {
  for (const std::uint8_t state : {std::uint8_t{0x00}, std::uint8_t{0x04}}) {
    Bench<> one;
    one.poll();
    ASSERT_EQ(one.write(0x1016, 1, 0x7FU << 16 | 50, 4), Abort::none);
    one.start();
    one.send(0x77F, {state});  // before its first heartbeat: not yet watched
    one.poll();
    EXPECT_FALSE(one.node.errors().any());
    auto tick = [&, i = std::size_t{0}](std::uint8_t heartbeat) mutable {
      one.send(0x77F, {heartbeat});
      one.tick(test::motion(i++));
    };
    for (int n = 0; n < 100; ++n) tick(n % 2 == 0 ? 0x05 : 0x7F);
    EXPECT_FALSE(one.node.errors().any());
    EXPECT_NE(one.node.torque(1), 0);
    for (int n = 0; n < 60; ++n) tick(state);
    EXPECT_TRUE(one.node.errors().is_present(Error::heartbeat_lost));
    EXPECT_EQ(one.counted(Counter::lost_heartbeats), 1U);
    EXPECT_EQ(one.node.torque(1), 0);
    for (int n = 0; n < 60; ++n) tick(0x05);
    EXPECT_FALSE(one.node.errors().any());
    EXPECT_NE(one.node.torque(1), 0);
    tick(0x33);  // no state that CiA 301 knows
    EXPECT_EQ(one.counted(Counter::malformed_frames), 1U);
  }
}

// Lost is more than the time, not as much.
TEST_F(DriveNodeObjects, AHeartbeatInTimeToTheMicrosecondIsInTime) {
  bench.poll();
  ASSERT_EQ(bench.write(0x1016, 1, 0x7FU << 16 | 50, 4), Abort::none);
  bench.send(0x77F, {0x05});
  bench.poll();
  bench.clock.advance(50'000);
  bench.poll();
  EXPECT_FALSE(bench.node.errors().any());
  bench.clock.advance(1);
  bench.poll();
  EXPECT_TRUE(bench.node.errors().is_present(Error::heartbeat_lost));
  EXPECT_EQ(bench.node.errors().error_register(), 0x11);
}

TEST_F(DriveNodeObjects, HeartbeatsOfAWrongLengthAreNone) {
  bench.poll();
  ASSERT_EQ(bench.write(0x1016, 1, 0x7FU << 16 | 50, 4), Abort::none);
  bench.send(0x77F, {0x05});
  bench.poll();
  for (int i = 0; i < 10; ++i) {
    bench.pass(10'000);
    bench.send(0x77F, i % 2 == 0 ? Bytes{} : Bytes{0x05, 0x00});
    bench.poll();
  }
  EXPECT_TRUE(bench.node.errors().is_present(Error::heartbeat_lost));
  EXPECT_EQ(bench.counted(Counter::malformed_frames), 10U);
}

TEST(ErrorKinds, CommunicationErrorsSayTheirBits) {
  for (std::size_t i = 0; i < error_kinds.size(); ++i) {
    ErrorLog log;
    log.raise(static_cast<Error>(i), 0, 0);
    const bool communication = error_kinds[i].code >= 0x8000;
    EXPECT_EQ(log.error_register(), communication ? 0x11 : 0x01) << std::hex << error_kinds[i].code;
  }
}

// --- SYNC ------------------------------------------------------------------------------------------------------------

TEST_F(DriveNodeObjects, ARemoteSyncIsNone) {
  run();
  auto frame = bench.frame(canopen::sync_id, {});
  frame.remote = true;
  bench.send_setpoints(test::motion(k));
  bench.send(frame);
  bench.poll();
  EXPECT_TRUE(bench.torques().empty());
  EXPECT_EQ(bench.counted(Counter::malformed_frames), 1U);
}

// --- SDO -------------------------------------------------------------------------------------------------------------

// The label holds 32 bytes: the fifth segment of seven does not fit as a whole, however short the size was told.
TEST_F(DriveNodeObjects, SegmentsThatOverflowAreRefused) {
  bench.poll();
  const Bytes fits(32, 'x'), too_long(33, 'y');
  EXPECT_EQ(bench.write_segments(0x2003, 0, fits, false), Abort::none);
  EXPECT_EQ(bench.write_segments(0x2003, 0, too_long, false), Abort::too_long);
  EXPECT_EQ(bench.text(0x2003), std::string(32, 'x'));
}

// --- costs -----------------------------------------------------------------------------------------------------------

/// Says of each stretch what a test wants.
TEST_F(DriveNodeObjects, TheMostOfACostIsKept) {
  run();
  std::uint32_t most_model = 0, most_everything = 0;
  for (int i = 0; i < 20; ++i) {
    bench.tick(test::motion(k++));
    most_model = std::max(most_model, bench.read(0x2002, 1));
    most_everything = std::max(most_everything, bench.read(0x2002, 3));
    EXPECT_GE(bench.read(0x2002, 2), most_model);
    EXPECT_GE(bench.read(0x2002, 4), most_everything);
  }
  // the fake counter counts up, so the last cost is the largest
  EXPECT_EQ(bench.read(0x2002, 2), most_model);
  bench.heard();
}

// --- what waits, what was -------------------------------------------------------------------------------------------

// Bus-off: what waited is dropped and counted, and does not go out when the node is back.
TEST_F(DriveNodeObjects, WhatWaitedAtBusOffIsDropped) {
  run();
  bench.on_wire.bus.busy = 1'000'000;
  bench.send_setpoints(test::motion(k++));
  bench.send(canopen::sync_id, {});
  EXPECT_TRUE(bench.node.poll());  // the torques wait
  const std::uint32_t lost = bench.counted(Counter::lost_sent);
  bench.on_wire.bus.fall_off_the_bus(20);
  bench.on_wire.bus.busy = 0;
  bench.wire.sent.clear();
  bench.clock.advance(100);
  static_cast<void>(bench.node.poll());
  EXPECT_EQ(bench.counted(Counter::lost_sent) - lost, 6U);  // six torques
  EXPECT_FALSE(bench.node.poll());                          // nothing is left to do
}

// Set up anew, an operation does not compare with the positions of the last one.
TEST_F(DriveNodeObjects, AfterLeavingOperationNoPositionIsAJump) {
  run();
  bench.nmt(canopen::NmtCommand::enter_pre_operational);
  bench.nmt(canopen::NmtCommand::start);
  bench.tick(test::motion(4000));
  EXPECT_EQ(bench.counted(Counter::implausible_setpoints), 0U);
  EXPECT_EQ(bench.counted(Counter::stale_ticks), 0U);
}

// A processor that was away for long makes one tick and one step of the ramp for it, no burst.
TEST_F(DriveNodeObjects, ALongAbsenceIsNoBurstOfTicks) {
  run();
  const std::uint32_t before = bench.counted(Counter::overdue_syncs);
  bench.clock.advance(100'000);
  bench.poll();
  bench.poll();
  EXPECT_EQ(bench.counted(Counter::overdue_syncs) - before, 1U);
  bench.clock.advance(1999);
  bench.poll();
  EXPECT_EQ(bench.counted(Counter::overdue_syncs) - before, 1U);
  bench.clock.advance(1);
  bench.poll();
  EXPECT_EQ(bench.counted(Counter::overdue_syncs) - before, 2U);
}

TEST_F(DriveNodeObjects, ALongAbsenceIsNoBurstOfRampSteps) {
  run();
  bench.nmt(canopen::NmtCommand::stop);
  const std::int32_t before = bench.node.torque(1);
  const std::int32_t ramp = (tables::page.parameters.constants[1].limits.tau_upper.raw + 49) / 50;
  ASSERT_GT(std::abs(before), 3 * ramp);
  bench.clock.advance(100'000);
  for (int i = 0; i < 10; ++i) bench.poll();
  EXPECT_EQ(std::abs(before) - std::abs(bench.node.torque(1)), ramp);
}

// Up to 20 ms the ticks feed the watchdog; a tick that long is no real time.
TEST_F(DriveNodeObjects, OnlyFastTicksAreSupervised) {
  for (const std::uint32_t tick_us : {20'000U, 25'000U}) {
    auto parameters = tables::page.parameters;
    parameters.ticks_per_second.raw = static_cast<std::int32_t>((1000U << count_bits) / (tick_us / 1000));
    Bench<> slow({.board = "bench"}, true, parameters);
    slow.start();
    slow.send_setpoints(test::motion(0));
    slow.sync();
    const std::uint32_t feeds = slow.on_wire.watchdog.feeds;
    slow.node.poll();
    EXPECT_EQ(slow.on_wire.watchdog.feeds - feeds, tick_us <= 20'000 ? 0U : 1U) << tick_us;
  }
}

}  // namespace
}  // namespace fxdyn
