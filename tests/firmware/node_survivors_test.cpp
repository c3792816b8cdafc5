// What mutants of the drive node lived on.

#include <gtest/gtest.h>

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
