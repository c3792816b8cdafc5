// What mutants of the drive node lived on.

#include <gtest/gtest.h>

#include <cmath>

#include "tests/firmware/node_bench.hpp"

namespace fxdyn {
namespace {

using canopen::Abort;
using test::Bench;
using test::Bytes;

Abort abort_of(const Bytes& answer) {
  return answer[0] == 0x80 ? static_cast<Abort>(canopen::load<4>(&answer[4])) : Abort::none;
}

// A number of 2 bytes in segments of 7: the first one is refused, not only the last.
TEST(NodeSurvivors, ASegmentThatOverflowsIsRefusedAtOnce) {
  Bench<> bench;
  bench.poll();
  const auto answer_to = [&](const Bytes& request) {
    bench.send(canopen::sdo_request_id + bench.node.id(), request);
    bench.poll();
    const auto answers = bench.heard(canopen::sdo_answer_id + bench.node.id());
    EXPECT_EQ(answers.size(), 1U);
    return answers.at(0);
  };
  EXPECT_EQ(abort_of(answer_to({0x20, 0x10, 0x20, 0, 0, 0, 0, 0})), Abort::none) << "0x2010, its size not given";
  EXPECT_EQ(abort_of(answer_to({0x00, 1, 2, 3, 4, 5, 6, 7})), Abort::too_long) << "seven bytes, and more to come";
}

TEST(NodeSurvivors, TheMostOfACostStaysWhereTheNextOneIsLess) {
  Bench<> bench;
  bench.start();
  std::size_t k = 0;
  while (k < 20) bench.tick(test::motion(k++));
  const std::uint32_t most_model = bench.read(0x2002, 2), most = bench.read(0x2002, 4);
  bench.on_wire.counter.start_over();
  bench.tick(test::motion(k++));
  EXPECT_LT(bench.read(0x2002, 1), most_model);
  EXPECT_EQ(bench.read(0x2002, 2), most_model);
  EXPECT_LT(bench.read(0x2002, 3), most);
  EXPECT_EQ(bench.read(0x2002, 4), most);
}

TEST(NodeSurvivors, WhyItDoesNotStartHasNoDetail) {
  Bench<> bench({.board = "bench"}, false);
  bench.pass(1000);
  bench.heard();
  bench.nmt(canopen::NmtCommand::start);
  bench.pass(1'000'000);
  const auto emergencies = bench.heard(canopen::emergency_id + bench.node.id());
  ASSERT_EQ(emergencies.size(), 1U);
  EXPECT_EQ(canopen::load<2>(&emergencies[0][0]), 0x6320U);
  EXPECT_EQ(canopen::load<2>(&emergencies[0][3]), 0U);
}

// CiA 301, 7.3.2: a stopped node speaks with its heartbeat alone.
TEST(NodeSurvivors, AnEmergencyWaitsWhileTheNodeIsStopped) {
  Bench<> bench;
  bench.start();
  bench.nmt(canopen::NmtCommand::stop);
  bench.send(canopen::sync_id, {1, 2});  // a SYNC with two bytes
  bench.pass(1'000);
  EXPECT_TRUE(bench.emergencies().empty());
  bench.nmt(canopen::NmtCommand::enter_pre_operational);
  bench.pass(1'000);
  EXPECT_EQ(bench.emergencies(), std::vector<std::uint16_t>{0x8240});
}

TEST(NodeSurvivors, AResetForgetsTheLabel) {
  Bench<> bench;
  bench.poll();
  ASSERT_EQ(bench.write_segments(0x2003, 0, {'l', 'e', 'f', 't', ' ', 'a', 'r', 'm'}), Abort::none);
  ASSERT_EQ(bench.text(0x2003), "left arm");
  bench.nmt(canopen::NmtCommand::reset_communication);
  bench.pass(1'000);
  EXPECT_EQ(bench.text(0x2003), "");
}

// The pin may stand where it stood before the reset.
TEST(NodeSurvivors, TheFaultOutputIsSetAtTheStartAlsoWithoutAFault) {
  Bench<> bench;
  bench.on_wire.fault.level = true;
  bench.pass(1'000);
  EXPECT_FALSE(bench.on_wire.fault.level);
}

/// What the velocity limit of joint 1 allows from one tick to the next, twice: more is a jump.
std::int32_t jump() {
  using N = test::Robot::Numbers;
  const double dq = std::ldexp(tables::page.parameters.constants[0].limits.dq_upper.raw, -Velocity<N>::bits);
  return static_cast<std::int32_t>(std::ldexp(2 * dq * 0.002, Position<N>::bits));
}

// Two SYNCs at once are one period of the motion: a jump of one and a half periods' worth is none that two allow.
TEST(NodeSurvivors, ASyncThatComesTwiceIsOnePeriod) {
  Bench<> bench;
  bench.start();
  std::size_t k = 0;
  while (k < 10) bench.tick(test::motion(k++));
  bench.send_setpoints(test::motion(k));
  bench.sync();
  bench.pass(200);
  bench.sync();
  bench.pass(1800);
  auto setpoints = test::motion(k);
  setpoints[0].q += jump() + jump() / 2;
  bench.send_setpoints(setpoints);
  bench.sync();
  EXPECT_EQ(bench.counted(dictionary::Counter::implausible_setpoints), 1U);
  EXPECT_EQ(bench.counted(dictionary::Counter::ticks), 11U);
  EXPECT_EQ(bench.counted(dictionary::Counter::stale_ticks), 2U) << "the SYNC that came twice, and the jump";
}

// The node's own tick comes half a period after a SYNC that was lost. Less than a quarter later the SYNC is the lost
// one, with the setpoints of one period; from then on the next one, with those of two.
TEST(NodeSurvivors, AQuarterAfterTheNodesOwnTickBeginsTheNextPeriod) {
  for (const std::uint32_t after_us : {499U, 500U}) {
    for (const int sent : {1, 2}) {
      Bench<> bench;
      bench.start();
      std::size_t k = 0;
      while (k < 9) bench.tick(test::motion(k++));
      bench.send_setpoints(test::motion(k++));
      bench.sync();
      bench.pass(3000);
      ASSERT_EQ(bench.counted(dictionary::Counter::overdue_syncs), 1U);
      for (int i = 0; i < sent; ++i) bench.send_setpoints(test::motion(k++));
      bench.pass(after_us);
      bench.sync();
      const bool fits = sent == (after_us < 500 ? 1 : 2);
      EXPECT_EQ(bench.counted(dictionary::Counter::ticks), fits ? 11U : 10U) << after_us << ' ' << sent;
    }
  }
}

/// Whether 256 periods that take `over_us` more than their ticks are a wrong rate.
bool is_wrong_rate(std::uint64_t over_us) {
  Bench<> bench;
  bench.start();
  std::uint64_t passed = 0;
  for (std::uint64_t i = 1; i <= 257; ++i) {
    bench.send_setpoints(test::motion(i));
    bench.sync();
    const std::uint64_t until = 2000 * i + over_us * i / 256;
    bench.pass(until - passed);
    passed = until;
  }
  return bench.node.errors().is_present(Error::sync_rate);
}

// Two ticks and a 64th of 256 ticks: 4 ms and 8 ms.
TEST(NodeSurvivors, ARateMayBeOffByTwoTicksAndA64th) {
  EXPECT_FALSE(is_wrong_rate(12'000));
  EXPECT_TRUE(is_wrong_rate(12'001));
}

/// A cost as the node keeps it; asking by SDO would be work of its own.
std::uint32_t cost_in_thousands(const Bench<>& bench, std::uint8_t sub_index) {
  dictionary::Object object;
  EXPECT_EQ(bench.node.find(0x2002, sub_index, object), Abort::none);
  std::array<std::uint8_t, dictionary::longest_string> bytes{};
  bench.node.read(object, bytes.data());
  return canopen::load<4>(bytes.data()) / 1000;
}

// The fake counter's n-th measurement takes n thousand, from its start on. With the model's n-th: six setpoints, what
// is before the model, the model, what is after it; and of the poll of the tick before, of which the model was the m-th
// measurement, what came after that tick: the end of its frame and, after a look at an empty bus, what is due.
TEST(NodeSurvivors, EveryStretchIsMeasuredOnce) {
  Bench<> bench;
  bench.start();
  bench.tick(test::motion(0));
  const std::uint32_t m = cost_in_thousands(bench, 1);
  bench.tick(test::motion(1));
  const std::uint32_t n = cost_in_thousands(bench, 1);
  std::uint32_t all = (m + 2) + (m + 4);
  for (std::uint32_t i = n - 7; i <= n + 1; ++i) all += i;
  EXPECT_EQ(cost_in_thousands(bench, 3), all) << m << ' ' << n;
}

// A tick and a half after the last SYNC, when the next one is overdue, and not before.
TEST(NodeSurvivors, OutOfOperationTheTorqueIsReleasedATickAndAHalfAfterTheLastOne) {
  Bench<> bench;
  bench.start();
  std::size_t k = 0;
  while (k < 60) bench.tick(test::motion(k++));
  bench.send_setpoints(test::motion(k));
  bench.sync();
  const std::int32_t held = bench.node.torque(1);
  ASSERT_NE(held, 0);
  bench.nmt(canopen::NmtCommand::enter_pre_operational);
  bench.pass(2999);
  EXPECT_EQ(bench.node.torque(1), held);
  bench.pass(1);
  EXPECT_LT(std::abs(bench.node.torque(1)), std::abs(held));
}

TEST(NodeSurvivors, TheTickCountIsOfAllTicksSinceTheStart) {
  Bench<> bench;
  bench.start();
  std::uint32_t ticks = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    const auto torques = k == 2 ? bench.tick_without_setpoints() : bench.tick(test::motion(k));
    ++ticks;
    ASSERT_EQ(torques.size(), 6U);
    for (const auto& torque : torques) EXPECT_EQ(torque.tick, ticks);
    EXPECT_EQ(bench.counted(dictionary::Counter::ticks) + bench.counted(dictionary::Counter::stale_ticks), ticks);
  }
}

/// What all of the first tick costs after `frames` foreign ones that came before operation was left, and a start anew.
std::uint32_t cost_after_a_pause(int frames) {
  Bench<> bench;
  bench.start();
  bench.tick(test::motion(0));
  for (int i = 0; i < frames; ++i) {
    bench.send(0x7E5, {});
    bench.poll();
  }
  bench.on_wire.counter.start_over();
  bench.nmt(canopen::NmtCommand::enter_pre_operational);
  bench.nmt(canopen::NmtCommand::start);
  bench.tick(test::motion(1));
  return cost_in_thousands(bench, 3);
}

TEST(NodeSurvivors, WhatCameBeforeOperationWasLeftIsNoCostOfTheNextTick) {
  EXPECT_EQ(cost_after_a_pause(20), cost_after_a_pause(0));
}

// CiA 301, 7.2.4.3: expedited, e = 1 and s = 0, the four bytes of the frame; more of them it does not have.
TEST(NodeSurvivors, AnExpeditedTextWithoutASizeHasFourBytes) {
  Bench<> bench;
  bench.poll();
  ASSERT_EQ(abort_of(bench.request({0x22, 0x03, 0x20, 0, 'a', 'r', 'm', '1'})), Abort::none);
  EXPECT_EQ(bench.text(0x2003), "arm1");
}

// CiA 301, 7.2.4.3: 0504 0001h, command specifier not valid. The last segment ended the transfer.
TEST(NodeSurvivors, ASegmentAfterTheLastOneIsRefused) {
  Bench<> bench;
  bench.poll();
  ASSERT_EQ(bench.write_segments(0x2003, 0, {'1', '2', '3', '4', '5', '6', '7'}), Abort::none);
  bench.request(Bench<>::initiate(0x40, 0x2003, 0));
  const Bytes only = bench.request({0x60, 0, 0, 0, 0, 0, 0, 0});
  ASSERT_EQ(only.size(), 8U);
  EXPECT_EQ(only[0], 0x01) << "seven bytes, and no more";
  EXPECT_EQ(abort_of(bench.request({0x70, 0, 0, 0, 0, 0, 0, 0})), Abort::unknown_command);
}

// Object 0x2000:8 and the detail of an EMCY: numbers on the wire, which no version may change.
TEST(NodeSurvivors, TheNumbersOfAnUpdatesStateAreThoseOfTheGuide) {
  EXPECT_EQ(static_cast<int>(UpdateSlot::empty), 0);
  EXPECT_EQ(static_cast<int>(UpdateSlot::used), 1);
  EXPECT_EQ(static_cast<int>(UpdateSlot::same), 2);
  EXPECT_EQ(static_cast<int>(UpdateSlot::older), 3);
  EXPECT_EQ(static_cast<int>(UpdateSlot::other_origin), 4);
  EXPECT_EQ(static_cast<int>(UpdateSlot::other_layout), 5);
  EXPECT_EQ(static_cast<int>(UpdateSlot::damaged), 6);
  EXPECT_EQ(static_cast<int>(UpdateSlot::unreadable), 7);
}

}  // namespace
}  // namespace fxdyn
