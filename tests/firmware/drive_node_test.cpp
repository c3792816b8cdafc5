// The services of CiA 301 and the tick of the drive node, on a bus in memory.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <random>

#include "model/version.hpp"
#include "tests/firmware/node_bench.hpp"

namespace fxdyn {
namespace {

using canopen::Abort;
using canopen::NmtCommand;
using canopen::NmtState;
using dictionary::Counter;
using test::Bench;
using test::Bytes;

constexpr std::uint8_t state_byte(NmtState state) { return static_cast<std::uint8_t>(state); }

class DriveNodeTest : public ::testing::Test {
 protected:
  Bench<> bench;
};

// --- boot-up, NMT, heartbeat -----------------------------------------------------------------------------------------

TEST_F(DriveNodeTest, BootsUp) {
  EXPECT_EQ(bench.node.state(), NmtState::initialising);
  bench.poll();
  EXPECT_EQ(bench.heard(0x701), (std::vector<Bytes>{{0x00}}));
  EXPECT_EQ(bench.node.state(), NmtState::pre_operational);
  EXPECT_FALSE(bench.on_wire.fault.level);
}

TEST_F(DriveNodeTest, BootsUpWhenTheBusIsThere) {
  bench.on_wire.bus.down = true;
  for (int i = 0; i < 20; ++i) bench.on_wire.node.poll();
  EXPECT_EQ(bench.node.state(), NmtState::initialising);
  bench.on_wire.bus.down = false;
  bench.on_wire.bus.busy = 3;
  bench.pass(10'000);
  EXPECT_EQ(bench.heard(0x701), (std::vector<Bytes>{{0x00}}));
  EXPECT_EQ(bench.node.state(), NmtState::pre_operational);
}

// What waited when the reset came is not sent ahead of the boot-up message, nor taken for it.
TEST_F(DriveNodeTest, TheBootUpMessageIsTheFirstAfterAReset) {
  bench.start();
  bench.on_wire.bus.busy = 1'000'000;
  bench.clock.advance(200'000);
  bench.node.poll();  // a heartbeat waits
  bench.send(0, {0x81, 0x00});
  bench.send(0, {0x01, 0x00});  // too early
  bench.node.poll();
  EXPECT_EQ(bench.node.state(), NmtState::initialising);
  bench.on_wire.bus.busy = 0;
  bench.pass(20'000);
  EXPECT_EQ(bench.node.state(), NmtState::pre_operational);
  const auto frames = bench.heard();
  ASSERT_FALSE(frames.empty());
  EXPECT_EQ(frames[0].id, 0x701U);
  EXPECT_EQ(frames[0].data[0], 0x00);
}

// A bus that takes nothing is asked again and again, but each frame that is lost is one.
TEST_F(DriveNodeTest, LostFramesDoNotRunAwayWhileTheBusIsDown) {
  bench.on_wire.bus.down = true;
  bench.pass(1'000'000);
  EXPECT_EQ(bench.node.state(), NmtState::initialising);
  EXPECT_GE(bench.counted(Counter::lost_sent), 50U);
  EXPECT_LE(bench.counted(Counter::lost_sent), 101U);
}

TEST_F(DriveNodeTest, FollowsNmt) {
  bench.poll();
  const std::pair<NmtCommand, NmtState> steps[] = {{NmtCommand::start, NmtState::operational},
                                                   {NmtCommand::stop, NmtState::stopped},
                                                   {NmtCommand::enter_pre_operational, NmtState::pre_operational},
                                                   {NmtCommand::start, NmtState::operational},
                                                   {NmtCommand::enter_pre_operational, NmtState::pre_operational},
                                                   {NmtCommand::stop, NmtState::stopped},
                                                   {NmtCommand::start, NmtState::operational}};
  for (const auto& [command, state] : steps) {
    bench.nmt(command, 2);  // another node's
    EXPECT_NE(bench.node.state(), state);
    bench.nmt(command, 1);
    EXPECT_EQ(bench.node.state(), state);
  }
}

TEST_F(DriveNodeTest, MalformedNmtDoesNothing) {
  bench.poll();
  bench.send(0, {0x01});
  bench.send(0, {0x01, 0x00, 0x00});
  bench.send(0, {0x55, 0x00});
  auto remote = bench.frame(0, {0x01, 0x00});
  remote.remote = true;
  bench.send(remote);
  bench.poll();
  EXPECT_EQ(bench.node.state(), NmtState::pre_operational);
  EXPECT_EQ(bench.counted(Counter::malformed_frames), 4U);
}

TEST_F(DriveNodeTest, ResetsGoBackToTheDefaults) {
  for (const NmtCommand command : {NmtCommand::reset_node, NmtCommand::reset_communication}) {
    bench.start();
    EXPECT_EQ(bench.write(0x1017, 0, 50, 2), Abort::none);
    EXPECT_EQ(bench.write(0x2010, 0, 7, 2), Abort::none);
    bench.heard();
    bench.nmt(command);
    bench.poll();
    EXPECT_EQ(bench.heard(0x701), (std::vector<Bytes>{{0x00}}));
    EXPECT_EQ(bench.node.state(), NmtState::pre_operational);
    EXPECT_EQ(bench.read(0x1017), 100U);
    EXPECT_EQ(bench.read(0x2010), 50U);
  }
  EXPECT_EQ(bench.counted(Counter::nmt_resets), 2U);
}

TEST_F(DriveNodeTest, HeartbeatTellsTheState) {
  bench.poll();
  bench.heard();
  bench.pass(1'000'000);
  EXPECT_EQ(bench.heard(0x701), std::vector<Bytes>(10, {state_byte(NmtState::pre_operational)}));
  bench.nmt(NmtCommand::stop);
  bench.pass(100'000);
  EXPECT_EQ(bench.heard(0x701), std::vector<Bytes>(1, {state_byte(NmtState::stopped)}));
  bench.nmt(NmtCommand::start);
  bench.pass(100'000);
  EXPECT_EQ(bench.heard(0x701), std::vector<Bytes>(1, {state_byte(NmtState::operational)}));
}

TEST_F(DriveNodeTest, HeartbeatPeriodIsAnObject) {
  bench.poll();
  EXPECT_EQ(bench.write(0x1017, 0, 20, 2), Abort::none);
  bench.heard();
  bench.pass(200'000);
  EXPECT_EQ(bench.heard(0x701).size(), 10U);
  EXPECT_EQ(bench.write(0x1017, 0, 0, 2), Abort::none);
  bench.heard();
  bench.pass(1'000'000);
  EXPECT_EQ(bench.heard(0x701).size(), 0U);
}

// --- SDO -------------------------------------------------------------------------------------------------------------

TEST_F(DriveNodeTest, IdentityAndTables) {
  bench.poll();
  EXPECT_EQ(bench.read(0x1000), 0U);
  EXPECT_EQ(bench.read(0x1018, 0), 4U);
  EXPECT_EQ(bench.read(0x1018, 2), dictionary::product_code);
  EXPECT_EQ(bench.read(0x1018, 3), version_number);
  EXPECT_EQ(bench.text(0x1008), "fxdyn drive node");
  EXPECT_EQ(bench.text(0x1009), "bench");
  EXPECT_EQ(bench.text(0x100A), version);
  EXPECT_EQ(bench.text(0x2002, 5), "thousandths") << "what the board's counter counts";
  EXPECT_EQ(bench.read(0x2000, 1), 0x1234'5678U);
  EXPECT_EQ(bench.read(0x2000, 2), test::Robot::layout_hash());
  EXPECT_EQ(bench.read(0x2000, 3), 1U);
  EXPECT_EQ(bench.read(0x2000, 4), 6U);
  EXPECT_EQ(bench.read(0x2000, 5), 0x3FU);
  EXPECT_EQ(bench.read(0x2020, 1), 28U);
  EXPECT_EQ(bench.read(0x2020, 4), 22U);
  for (std::uint8_t j = 1; j <= 6; ++j) {
    const auto& limits = tables::page.parameters.constants[j - 1U].limits;
    EXPECT_EQ(bench.read(0x2021, j), static_cast<std::uint32_t>(limits.dq_upper.raw));
    EXPECT_EQ(bench.read(0x2022, j), static_cast<std::uint32_t>(limits.ddq_upper.raw));
    EXPECT_EQ(bench.read(0x2023, j), static_cast<std::uint32_t>(limits.q_lower.raw));
    EXPECT_EQ(bench.read(0x2040, j), static_cast<std::uint32_t>(tables::rated_torque[j - 1U]));
    EXPECT_EQ(bench.read(0x2042, j), static_cast<std::uint32_t>(to_milli<22>(limits.tau_upper.raw)));
  }
}

// Every entry of the dictionary can be read, with the size of its type; what is not writable refuses to be written.
TEST_F(DriveNodeTest, EveryObjectAnswers) {
  bench.poll();
  for (const dictionary::Entry& entry : dictionary::entries) {
    for (std::uint8_t j = 0; j < 6; ++j) {
      if (!dictionary::Extent{6, 0x3F}.stands_at(entry, j)) continue;
      const std::uint32_t index = entry.index + j;
      const auto result = bench.upload(index, entry.sub_index);
      if (entry.variable == dictionary::Variable::error_field) {  // nothing has happened yet
        EXPECT_EQ(std::get<Abort>(result), Abort::no_data);
        continue;
      }
      ASSERT_TRUE(std::holds_alternative<Bytes>(result)) << std::hex << index << ":" << int{entry.sub_index};
      if (entry.type != dictionary::Type::visible_string) {
        EXPECT_EQ(std::get<Bytes>(result).size(), dictionary::size_of(entry.type));
      }
      if (entry.access != dictionary::Access::read_write) {
        EXPECT_EQ(bench.write(index, entry.sub_index, 0, 4), Abort::read_only);
      }
    }
  }
  EXPECT_EQ(bench.write(0x1018, 0, 0, 1), Abort::read_only);
}

// A value that was read can be written back, but for the history, which only 0 clears.
TEST_F(DriveNodeTest, WritableObjectsTakeTheirOwnValue) {
  bench.poll();
  for (const dictionary::Entry& entry : dictionary::entries) {
    if (entry.access != dictionary::Access::read_write || entry.type == dictionary::Type::visible_string) continue;
    const std::uint32_t value = bench.read(entry.index, entry.sub_index);
    EXPECT_EQ(bench.write(entry.index, entry.sub_index, value, dictionary::size_of(entry.type)), Abort::none)
        << std::hex << entry.index;
    EXPECT_EQ(bench.read(entry.index, entry.sub_index), value) << std::hex << entry.index;
    if (dictionary::size_of(entry.type) < 4) {
      EXPECT_EQ(bench.write(entry.index, entry.sub_index, value, 4), Abort::too_long) << std::hex << entry.index;
    } else {
      EXPECT_EQ(bench.write(entry.index, entry.sub_index, value, 2), Abort::too_short) << std::hex << entry.index;
    }
  }
}

TEST_F(DriveNodeTest, SegmentedTransfersInBothDirections) {
  bench.poll();
  EXPECT_EQ(bench.text(0x2003), "");
  for (const std::string text : {"", "a", "1234567", "12345678", "01234567890123456789012345678901"}) {
    for (const bool tell_size : {true, false}) {
      EXPECT_EQ(bench.write_segments(0x2003, 0, Bytes(text.begin(), text.end()), tell_size), Abort::none);
      EXPECT_EQ(bench.text(0x2003), text);
    }
  }
  EXPECT_EQ(bench.write_segments(0x2003, 0, Bytes(33, 'x')), Abort::too_long);
  EXPECT_EQ(bench.write_segments(0x2003, 0, Bytes(33, 'x'), false), Abort::too_long);
  EXPECT_EQ(bench.write_segments(0x2010, 0, {0x23, 0x00}), Abort::none);  // a number may come in segments too
  EXPECT_EQ(bench.read(0x2010), 0x23U);
  EXPECT_EQ(bench.write_segments(0x2010, 0, {0x23}, false), Abort::too_short);
  EXPECT_EQ(bench.read(0x2010), 0x23U);
}

TEST_F(DriveNodeTest, BytesOfTheTransfers) {
  bench.poll();
  // expedited upload of two bytes
  EXPECT_EQ(bench.request({0x40, 0x10, 0x20, 0x00, 0, 0, 0, 0}), (Bytes{0x4B, 0x10, 0x20, 0x00, 50, 0, 0, 0}));
  // segmented upload: size 16, then 7, 7, 2 bytes with the toggle bit
  EXPECT_EQ(bench.request({0x40, 0x08, 0x10, 0x00, 0, 0, 0, 0}), (Bytes{0x41, 0x08, 0x10, 0x00, 16, 0, 0, 0}));
  EXPECT_EQ(bench.request({0x60, 0, 0, 0, 0, 0, 0, 0}), (Bytes{0x00, 'f', 'x', 'd', 'y', 'n', ' ', 'd'}));
  EXPECT_EQ(bench.request({0x70, 0, 0, 0, 0, 0, 0, 0}), (Bytes{0x10, 'r', 'i', 'v', 'e', ' ', 'n', 'o'}));
  EXPECT_EQ(bench.request({0x60, 0, 0, 0, 0, 0, 0, 0}), (Bytes{0x0B, 'd', 'e', 0, 0, 0, 0, 0}));
  // expedited download, size not told
  EXPECT_EQ(bench.request({0x22, 0x10, 0x20, 0x00, 9, 0, 0, 0}), (Bytes{0x60, 0x10, 0x20, 0x00, 0, 0, 0, 0}));
  EXPECT_EQ(bench.read(0x2010), 9U);
  // an abort
  EXPECT_EQ(bench.request({0x40, 0x00, 0x50, 0x00, 0, 0, 0, 0}), (Bytes{0x80, 0x00, 0x50, 0x00, 0, 0, 0x02, 0x06}));
}

TEST_F(DriveNodeTest, SdoErrorsAbort) {
  using B = Bench<>;
  bench.poll();
  const auto abort = [&](const Bytes& request) { return B::abort_of(bench.request(request)); };
  EXPECT_EQ(abort(B::initiate(0x40, 0x5000, 0)), Abort::no_object);
  EXPECT_EQ(abort(B::initiate(0x40, 0x1018, 9)), Abort::no_sub_index);
  EXPECT_EQ(abort(B::initiate(0x23, 0x1018, 1)), Abort::read_only);
  EXPECT_EQ(abort(B::initiate(0xA0, 0x1018, 1)), Abort::unknown_command);  // block upload
  EXPECT_EQ(abort(B::initiate(0xC0, 0x2003, 0)), Abort::unknown_command);  // block download
  EXPECT_EQ(abort(B::initiate(0xE0, 0x2003, 0)), Abort::unknown_command);
  EXPECT_EQ(abort({0x60, 0, 0, 0, 0, 0, 0, 0}), Abort::unknown_command);  // no transfer is running
  EXPECT_EQ(abort({0x00, 0, 0, 0, 0, 0, 0, 0}), Abort::unknown_command);
  // the toggle bit, in both directions
  bench.request(B::initiate(0x40, 0x1008, 0));
  EXPECT_EQ(abort({0x70, 0, 0, 0, 0, 0, 0, 0}), Abort::toggle_bit);
  EXPECT_EQ(abort({0x60, 0, 0, 0, 0, 0, 0, 0}), Abort::unknown_command);
  bench.request(B::initiate(0x20, 0x2003, 0));
  EXPECT_EQ(abort({0x10, 'a', 0, 0, 0, 0, 0, 0}), Abort::toggle_bit);
  // fewer bytes than told
  bench.request(B::initiate(0x21, 0x2003, 0, 5));
  EXPECT_EQ(abort({0x09, 'a', 'b', 'c', 0, 0, 0, 0}), Abort::wrong_length);
  EXPECT_EQ(bench.text(0x2003), "");
  // values
  EXPECT_EQ(bench.write(0x1029, 1, 3, 1), Abort::too_high);
  EXPECT_EQ(bench.write(0x2011, 1, 0, 4), Abort::too_low);
  EXPECT_EQ(bench.write(0x2011, 1, 0xFFFF'FFFF, 4), Abort::too_low);
  EXPECT_EQ(bench.write(0x1003, 0, 1, 1), Abort::invalid_value);
  EXPECT_EQ(bench.write(0x1006, 0, 10, 4), Abort::too_low);
  EXPECT_EQ(bench.write(0x1006, 0, 0xFFFF'FFFF, 4), Abort::too_high);
  EXPECT_EQ(bench.write(0x2030, 0, 1, 1), Abort::too_high);  // no CAN FD here
  EXPECT_EQ(bench.counted(Counter::sdo_aborts), 19U);
}

TEST_F(DriveNodeTest, AClientCanAbort) {
  bench.poll();
  bench.request(Bench<>::initiate(0x40, 0x1008, 0));
  EXPECT_EQ(bench.request(Bench<>::initiate(0x80, 0x1008, 0, 0x0800'0000)), Bytes{});
  EXPECT_EQ(Bench<>::abort_of(bench.request({0x60, 0, 0, 0, 0, 0, 0, 0})), Abort::unknown_command);
}

TEST_F(DriveNodeTest, ATransferThatStopsTimesOut) {
  bench.poll();
  bench.request(Bench<>::initiate(0x40, 0x1008, 0));
  bench.pass(999'000);
  EXPECT_TRUE(bench.heard(0x581).empty());
  bench.pass(2000);
  EXPECT_EQ(bench.heard(0x581), (std::vector<Bytes>{{0x80, 0x08, 0x10, 0x00, 0x00, 0x00, 0x04, 0x05}}));
  bench.pass(3'000'000);
  EXPECT_TRUE(bench.heard(0x581).empty());
}

TEST_F(DriveNodeTest, NoSdoWhileStopped) {
  bench.poll();
  bench.nmt(NmtCommand::stop);
  EXPECT_EQ(bench.request(Bench<>::initiate(0x40, 0x1000, 0)), Bytes{});
  bench.nmt(NmtCommand::enter_pre_operational);
  EXPECT_EQ(bench.read(0x1000), 0U);
}

TEST_F(DriveNodeTest, SdoFramesOfAnotherLengthAreNoRequests) {
  bench.poll();
  for (std::size_t size = 0; size < 8; ++size) {
    Bytes request = Bench<>::initiate(0x40, 0x1000, 0);
    request.resize(size);
    EXPECT_EQ(bench.request(request), Bytes{});
  }
  EXPECT_EQ(bench.counted(Counter::malformed_frames), 8U);
}

// Random requests, random continuations of valid transfers: each is answered as CiA 301 says, the node goes on, and no
// object has another value than one that was written whole.
RC_GTEST_PROP(SdoFuzz, EveryRequestHasOneAnswer, ()) {
  Bench<> bench;
  bench.start();
  const auto steps = *rc::gen::inRange(1, 60);
  for (int i = 0; i < steps; ++i) {
    Bytes request = *rc::gen::container<Bytes>(8, rc::gen::arbitrary<std::uint8_t>());
    if (*rc::gen::arbitrary<bool>()) {  // an object that exists
      const auto& entry = dictionary::entries[*rc::gen::inRange<std::size_t>(0, dictionary::entries.size())];
      canopen::store<2>(&request[1], entry.index);
      request[3] = static_cast<std::uint8_t>(entry.sub_index + *rc::gen::inRange(0, 2));
    }
    if (*rc::gen::arbitrary<bool>())
      request[0] = *rc::gen::element<std::uint8_t>(0x40, 0x60, 0x70, 0x21, 0x20, 0x00, 0x10, 0x01);
    const Bytes answer = bench.request(request);
    RC_ASSERT(bench.node.state() == NmtState::operational);
    if (request[0] >> 5 == 4) {
      RC_ASSERT(answer.empty());
      continue;
    }
    RC_ASSERT(answer.size() == 8U);
    const unsigned asked = request[0] >> 5, answered = answer[0] >> 5;
    if (answered == 4) continue;  // abort
    RC_ASSERT((asked == 0 && answered == 1) || (asked == 1 && answered == 3) || (asked == 2 && answered == 2) ||
              (asked == 3 && answered == 0));
    if (asked == 1 || asked == 2) RC_ASSERT(std::equal(answer.begin() + 1, answer.begin() + 4, request.begin() + 1));
  }
  RC_ASSERT(bench.text(0x1008) == "fxdyn drive node");
  RC_ASSERT(bench.text(0x2003).size() <= 32U);
  RC_ASSERT(bench.read(0x1029, 1) <= 2U);
}

RC_GTEST_PROP(SdoFuzz, StringsArriveWhateverElseComes, ()) {
  Bench<> bench;
  bench.poll();
  const Bytes text = *rc::gen::resize(32, rc::gen::container<Bytes>(rc::gen::arbitrary<std::uint8_t>()));
  for (const Bytes& other :
       *rc::gen::container<std::vector<Bytes>>(rc::gen::container<Bytes>(8, rc::gen::arbitrary<std::uint8_t>()))) {
    bench.send(*rc::gen::inRange<std::uint32_t>(0x081, 0x600), other);  // not this node's SDO, nor NMT and SYNC
  }
  RC_PRE(text.size() <= 32);
  RC_ASSERT(bench.write_segments(0x2003, 0, text) == Abort::none);
  RC_ASSERT(bench.text(0x2003) == std::string(text.begin(), text.end()));
}

// --- PDO parameters --------------------------------------------------------------------------------------------------

TEST_F(DriveNodeTest, IdentifiersCanBeChangedBeforeOperation) {
  bench.poll();
  EXPECT_EQ(bench.read(0x1400, 1), 0x201U);
  EXPECT_EQ(bench.read(0x1405, 1), 0x206U);
  EXPECT_EQ(bench.read(0x1805, 1), 0x4000'0186U);
  EXPECT_EQ(bench.read(0x1605, 2), 0x2101'0610U);
  EXPECT_EQ(bench.read(0x1A00, 0), 4U);
  EXPECT_EQ(bench.write(0x1400, 1, 0x301, 4), Abort::device_state);  // it exists
  EXPECT_EQ(bench.write(0x1400, 1, 0x8000'0201, 4), Abort::none);
  EXPECT_EQ(bench.write(0x1400, 1, 0x301, 4), Abort::none);
  EXPECT_EQ(bench.write(0x1802, 1, 0xC000'0183, 4), Abort::none);
  EXPECT_EQ(bench.write(0x1802, 1, 0x4000'0383, 4), Abort::none);
  EXPECT_EQ(bench.write(0x1802, 1, 0x8000'0000, 4), Abort::invalid_value);  // restricted
  EXPECT_EQ(bench.write(0x1802, 1, 0x8000'0601, 4), Abort::invalid_value);  // restricted
  EXPECT_EQ(bench.write(0x1802, 1, 0xA000'0383, 4), Abort::invalid_value);  // 29 bits
  EXPECT_EQ(bench.write(0x1005, 0, 0x4000'0080, 4), Abort::invalid_value);  // generates no SYNC
  EXPECT_EQ(bench.write(0x1005, 0, 0x90, 4), Abort::none);
  EXPECT_EQ(bench.write(0x1804, 1, 0xC000'0185, 4), Abort::none);  // joint 5 is not sent
  bench.nmt(NmtCommand::start);
  EXPECT_EQ(bench.write(0x1400, 1, 0x8000'0301, 4), Abort::device_state);
  EXPECT_EQ(bench.write(0x1005, 0, 0x80, 4), Abort::device_state);
  bench.heard();
  const auto setpoints = test::motion(0);
  bench.send(0x301, bench.bytes_of(setpoints[0]));
  for (std::size_t j = 1; j < 6; ++j) bench.send_setpoint(j, setpoints[j]);
  bench.send(0x90, {});
  bench.poll();
  std::vector<std::uint32_t> ids;
  for (const auto& frame : bench.heard()) ids.push_back(frame.id);
  EXPECT_EQ(ids, (std::vector<std::uint32_t>{0x181, 0x182, 0x383, 0x184, 0x186}));
  EXPECT_EQ(bench.counted(Counter::ticks), 1U);
}

// --- the tick --------------------------------------------------------------------------------------------------------

/// Without a ramp what goes out is the model's torque from the first tick on.
void without_ramp(Bench<>& bench) {
  bench.poll();
  ASSERT_EQ(bench.write(0x2010, 0, 0, 2), Abort::none);
  bench.start();
}

TEST_F(DriveNodeTest, TorquesAreTheModelsBitForBit) {
  without_ramp(bench);
  test::Reference reference;
  for (std::size_t k = 0; k < 3000; ++k) {
    const auto setpoints = test::motion(k);
    const auto torques = bench.tick(setpoints);
    const auto expected = reference.tick(setpoints);
    ASSERT_EQ(torques.size(), 6U);
    for (std::size_t j = 0; j < 6; ++j) {
      const auto raw = expected[static_cast<int>(j)].raw;
      ASSERT_EQ(bench.node.torque(j), raw) << "tick " << k << " joint " << j + 1;
      const auto [per_mille, milli] = test::on_wire(raw, j);
      ASSERT_EQ(torques[j].per_mille, per_mille);
      ASSERT_EQ(torques[j].milli, milli);
      ASSERT_EQ(torques[j].tick, static_cast<std::uint8_t>(k + 1));
      ASSERT_EQ(torques[j].status, torque_status::fresh | torque_status::enabled);
    }
  }
  EXPECT_EQ(bench.counted(Counter::ticks), 3000U);
  EXPECT_EQ(bench.counted(Counter::saturations), reference.saturations.count);
  for (const Counter counter : {Counter::stale_ticks, Counter::lost_sent, Counter::foreign_frames,
                                Counter::malformed_frames, Counter::limited_steps})
    EXPECT_EQ(bench.counted(counter), 0U);
  EXPECT_EQ(bench.on_wire.tick_busy.rises, 3000);
  EXPECT_FALSE(bench.on_wire.tick_busy.level);
  EXPECT_FALSE(bench.on_wire.fault.level);
}

// Velocities and accelerations over the whole range of the wire: limits clamp, and saturations are counted as the model
// does.
TEST_F(DriveNodeTest, AnyVelocityAndAccelerationIsComputedAsTheModelDoes) {
  without_ramp(bench);
  test::Reference reference;
  std::mt19937 random(1);
  for (std::size_t k = 0; k < 1000; ++k) {
    auto setpoints = test::motion(k);
    for (auto& setpoint : setpoints) {
      setpoint.dq = static_cast<std::int16_t>(random());
      setpoint.ddq = static_cast<std::int16_t>(random());
    }
    bench.tick(setpoints);
    const auto expected = reference.tick(setpoints);
    for (std::size_t j = 0; j < 6; ++j) ASSERT_EQ(bench.node.torque(j), expected[static_cast<int>(j)].raw) << k;
  }
  EXPECT_EQ(bench.counted(Counter::saturations), reference.saturations.count);
}

TEST_F(DriveNodeTest, TheOrderOfSetpointsDoesNotMatter) {
  without_ramp(bench);
  test::Reference reference;
  std::mt19937 random(1);
  std::array<std::size_t, 6> order{0, 1, 2, 3, 4, 5};
  for (std::size_t k = 0; k < 200; ++k) {
    const auto setpoints = test::motion(k);
    std::shuffle(order.begin(), order.end(), random);
    for (const std::size_t j : order) bench.send_setpoint(j, setpoints[j]);
    bench.sync();
    const auto expected = reference.tick(setpoints);
    for (std::size_t j = 0; j < 6; ++j) ASSERT_EQ(bench.node.torque(j), expected[static_cast<int>(j)].raw);
    bench.pass(2000);
  }
}

TEST_F(DriveNodeTest, ProcessDataAreObjectsToo) {
  without_ramp(bench);
  const auto setpoints = test::motion(0);
  const auto torques = bench.tick(setpoints);
  for (std::uint8_t j = 1; j <= 6; ++j) {
    EXPECT_EQ(bench.read(0x2100, j), static_cast<std::uint32_t>(setpoints[j - 1U].q));
    EXPECT_EQ(bench.read(0x2101, j), static_cast<std::uint16_t>(setpoints[j - 1U].dq));
    EXPECT_EQ(bench.read(0x2110, j), static_cast<std::uint16_t>(torques[j - 1U].per_mille));
    EXPECT_EQ(bench.read(0x2111, j), static_cast<std::uint32_t>(torques[j - 1U].milli));
  }
  EXPECT_EQ(bench.read(0x2001, 1), 1U);
  EXPECT_EQ(bench.read(0x2002, 1) % 1000, 0U);
  EXPECT_GT(bench.read(0x2002, 3), bench.read(0x2002, 1));
}

TEST_F(DriveNodeTest, NoPdoOutsideOfOperation) {
  bench.poll();
  bench.heard();
  for (const NmtCommand command : {NmtCommand::enter_pre_operational, NmtCommand::stop}) {
    bench.nmt(command);
    EXPECT_TRUE(bench.tick(test::motion(0)).empty());
  }
  EXPECT_EQ(bench.counted(Counter::ticks) + bench.counted(Counter::stale_ticks), 0U);
}

TEST_F(DriveNodeTest, ABusyControllerLosesNothing) {
  without_ramp(bench);
  for (std::size_t k = 0; k < 20; ++k) {
    bench.on_wire.bus.busy = 17;
    EXPECT_EQ(bench.tick(test::motion(k)).size(), 6U);
  }
  EXPECT_EQ(bench.counted(Counter::lost_sent), 0U);
}

TEST_F(DriveNodeTest, ATorqueThatNobodyTookGivesWayToTheNext) {
  without_ramp(bench);
  bench.send_setpoints(test::motion(0));
  bench.on_wire.bus.busy = 1 << 20;
  bench.send(canopen::sync_id, {});
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(bench.node.poll());  // it has more to do
  bench.send_setpoints(test::motion(1));
  bench.send(canopen::sync_id, {});
  bench.node.poll();
  EXPECT_EQ(bench.counted(Counter::lost_sent), 6U);
  bench.on_wire.bus.busy = 0;
  bench.poll();
  const auto torques = bench.torques();
  ASSERT_EQ(torques.size(), 6U);
  for (const auto& torque : torques) EXPECT_EQ(torque.tick, 2);
}

// The session of docs/guide/can-node.md, byte for byte.
TEST_F(DriveNodeTest, TheSessionByHandOfTheGuide) {
  bench.poll();
  EXPECT_EQ(bench.request({0x40, 0x18, 0x10, 0x02, 0, 0, 0, 0}),
            (Bytes{0x43, 0x18, 0x10, 0x02, 0x46, 0x58, 0x44, 0x31}));
  EXPECT_EQ(bench.request({0x40, 0x0A, 0x10, 0x00, 0, 0, 0, 0}), (Bytes{0x41, 0x0A, 0x10, 0x00, 5, 0, 0, 0}));
  EXPECT_EQ(bench.request({0x60, 0, 0, 0, 0, 0, 0, 0}), (Bytes{0x05, '0', '.', '1', '.', '0', 0, 0}));
  EXPECT_EQ(bench.request({0x23, 0x06, 0x10, 0x00, 0, 0, 0, 0}), (Bytes{0x60, 0x06, 0x10, 0x00, 0, 0, 0, 0}));
  EXPECT_EQ(bench.request({0x2B, 0x10, 0x20, 0x00, 0, 0, 0, 0}), (Bytes{0x60, 0x10, 0x20, 0x00, 0, 0, 0, 0}));
  bench.start();
  for (std::size_t j = 0; j < 6; ++j) bench.send_setpoint(j, {});
  bench.sync();
  for (const int status : {0x11, 0x10, 0x12}) {
    const auto sent = bench.torques();
    ASSERT_EQ(sent.size(), 6U);
    for (const auto& torque : sent) {
      EXPECT_EQ(torque.status, status);
      if (status == 0x12) {
        EXPECT_EQ(torque.milli, 0);
      }
    }
    if (status != 0x12) bench.sync();
  }
  bench.pass(1'000'000);
  std::vector<Bytes> told;
  for (const auto& frame : bench.wire.sent) {
    if (frame.id == 0x081) told.emplace_back(frame.data.begin(), frame.data.end());
  }
  EXPECT_EQ(told, (std::vector<Bytes>{{0x50, 0x82, 0x11, 0x01, 0, 0, 0, 0}}));
  EXPECT_EQ(bench.request({0x40, 0x01, 0x20, 0x02, 0, 0, 0, 0}), (Bytes{0x43, 0x01, 0x20, 0x02, 2, 0, 0, 0}));
}

// --- CAN FD ----------------------------------------------------------------------------------------------------------

TEST(DriveNodeFd, OneFrameForAllSetpointsAndOneForAllTorques) {
  Bench<hal::FdFrame> bench;
  bench.poll();
  ASSERT_EQ(bench.write(0x2010, 0, 0, 2), Abort::none);
  ASSERT_EQ(bench.write(0x2030, 0, 1, 1), Abort::none);
  bench.start();
  EXPECT_EQ(bench.write(0x2030, 0, 0, 1), Abort::device_state);
  test::Reference reference;
  for (std::size_t k = 0; k < 500; ++k) {
    const auto setpoints = test::motion(k);
    Bytes all(48);
    for (std::size_t j = 0; j < 6; ++j) setpoints[j].store(&all[8 * j]);
    bench.send(0x201, all);
    bench.sync();
    const auto expected = reference.tick(setpoints);
    const auto frames = bench.heard(0x181);
    ASSERT_EQ(frames.size(), 1U);
    ASSERT_EQ(frames[0].size(), 48U);
    for (std::size_t j = 0; j < 6; ++j) {
      ASSERT_EQ(bench.node.torque(j), expected[static_cast<int>(j)].raw);
      const auto [per_mille, milli] = test::on_wire(expected[static_cast<int>(j)].raw, j);
      const WireTorque torque = WireTorque::load(&frames[0][8 * j]);
      ASSERT_EQ(torque.per_mille, per_mille);
      ASSERT_EQ(torque.milli, milli);
    }
    bench.pass(2000);
  }
  EXPECT_EQ(bench.counted(Counter::stale_ticks), 0U);
  // a classic setpoint is none now
  bench.send_setpoints(test::motion(0));
  bench.poll();
  EXPECT_EQ(bench.counted(Counter::malformed_setpoints), 6U);
}

TEST(DriveNodeFd, TalksClassicFramesUntilTold) {
  Bench<hal::FdFrame> bench;
  bench.start();
  EXPECT_EQ(bench.tick(test::motion(0)).size(), 6U);
  for (const auto& frame : bench.wire.sent) EXPECT_FALSE(frame.fd);
}

}  // namespace
}  // namespace fxdyn
