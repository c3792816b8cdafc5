// The drive node's image, executed: start-up, dictionary, ticks bit for bit, filters, pins.

#include "tests/emulated_g474/bench.hpp"
#include "tests/firmware/node_bench.hpp"

namespace {

using namespace fxdyn;
using namespace fxdyn::emulated;
using canopen::NmtCommand;
using dictionary::Counter;

std::optional<std::uint32_t> counted(Bench& bench, Counter counter) {
  return bench.read(0x2001, static_cast<std::uint8_t>(static_cast<int>(counter) + 1));
}

TEST(Node, StartsItsClocksFromTheCrystalAndBoots) {
  Bench bench;
  ASSERT_TRUE(bench.boot());
  EXPECT_TRUE(bench.board.clocks.runs_from_crystal());
  EXPECT_GE(bench.board.clocks.processor_hz(), 160'000'000u);
  EXPECT_LE(bench.board.clocks.processor_hz(), 170'000'000u);
  EXPECT_TRUE(bench.board.clocks.boost());
  EXPECT_EQ(bench.board.clocks.wait_states(), 4u);
  EXPECT_DOUBLE_EQ(bench.board.fdcan.bit_rate(), 1e6);
  EXPECT_DOUBLE_EQ(bench.board.fdcan.data_bit_rate(), 2e6);
  EXPECT_TRUE(bench.board.fdcan.fd_enabled());
  EXPECT_LT(bench.board.now(), 30 * millisecond);
  EXPECT_EQ(bench.heard(0x701), (std::vector<Bytes>{{0x00}}));
  EXPECT_EQ(bench.board.clocks.read(0x94, bench.board.now()) >> 24, 0u) << "CSR: the reset flags are still there";
  bench.run_ms(1000);
  const auto beats = bench.heard();
  ASSERT_GE(Bench::take(beats, 0x701).size(), 9u);
  for (std::size_t i = 1; i < beats.size(); ++i) {
    EXPECT_EQ(beats[i].frame.id, 0x701u);
    EXPECT_EQ(beats[i].frame.data[0], 0x7f);
    EXPECT_NEAR(static_cast<double>(beats[i].at - beats[i - 1].at) / millisecond, 100, 0.55);  // it sleeps for 0.5 ms
  }
  const double all = static_cast<double>(beats.back().at - beats.front().at) / millisecond;
  EXPECT_NEAR(all, 100.0 * static_cast<double>(beats.size() - 1), 0.55) << "its clock is off";
  bench.expect_clean();
}

TEST(Node, LetsTwoInterruptsThroughThatDontPreemptEachOther) {
  Bench bench;
  ASSERT_TRUE(bench.boot());
  constexpr std::uint32_t fdcan1_it0 = 21, tim6 = 54;
  for (std::uint32_t i = 0; i < Core::interrupts; ++i)
    EXPECT_EQ(bench.board.core.is_enabled(i), i == fdcan1_it0 || i == tim6) << i;
  EXPECT_EQ(bench.board.core.priority_of(fdcan1_it0), bench.board.core.priority_of(tim6));
  // Both at once: the lower number first, then the other, without going back between them.
  bench.board.core.forget_taken();
  bench.board.core.pend(tim6);
  bench.board.core.pend(fdcan1_it0);
  bench.board.run(100 * microsecond);
  const auto& taken = bench.board.core.taken();
  ASSERT_GE(taken.size(), 2u);
  EXPECT_EQ(taken[0], Core::first_interrupt + fdcan1_it0);
  EXPECT_EQ(taken[1], Core::first_interrupt + tim6);
  bench.expect_clean();
}

TEST(Node, SleepsWhenNothingIsDue) {
  Bench bench;
  ASSERT_TRUE(bench.boot());
  const auto before = bench.board.core.instructions();
  bench.run_ms(100);
  EXPECT_LT(bench.board.core.instructions() - before, 100'000u);  // of 17 million cycles
  bench.board.core.forget_taken();
  bench.run_ms(100);
  const auto& taken = bench.board.core.taken();
  EXPECT_NEAR(static_cast<double>(std::count(taken.begin(), taken.end(), Core::first_interrupt + 54)), 200, 1);  // TIM6
}

TEST(Node, SaysWhoItIsAndWhichTablesItHas) {
  Bench bench;
  ASSERT_TRUE(bench.boot());
  EXPECT_EQ(bench.text(0x1008), "fxdyn drive node");
  EXPECT_EQ(bench.text(0x1009), "stm32g474");
  EXPECT_EQ(bench.read(0x1018, 2), dictionary::product_code);
  EXPECT_EQ(bench.read(0x2000, 1), tables::page.header.crc32);
  EXPECT_EQ(bench.read(0x2000, 2), tables::page.header.layout_hash);
  EXPECT_EQ(bench.read(0x2000, 3), 1u);
  EXPECT_EQ(bench.read(0x2000, 6), 0u);
  bench.expect_clean();
}

class Ticks : public testing::TestWithParam<bool> {};

TEST_P(Ticks, AreTheModelsBitForBit) {
  const bool fd = GetParam();
  Bench bench;
  ASSERT_TRUE(bench.boot());
  ASSERT_TRUE(bench.write(0x2010, 0, 0, 2));
  ASSERT_TRUE(bench.write(0x2030, 0, fd ? 1 : 0, 1));
  bench.nmt(NmtCommand::start);
  test::Reference reference;
  constexpr std::size_t ticks = 400;
  for (std::size_t k = 0; k < ticks; ++k) {
    const auto setpoints = test::motion(k);
    const auto expected = reference.tick(setpoints);
    const auto torques = bench.tick(setpoints, fd);
    ASSERT_EQ(torques.size(), test::robot_joints) << "tick " << k;
    for (std::size_t j = 0; j < test::robot_joints; ++j) {
      const auto [per_mille, milli] = test::on_wire(expected[static_cast<int>(j)].raw, j);
      ASSERT_EQ(torques[j].per_mille, per_mille) << "tick " << k << ", joint " << j;
      ASSERT_EQ(torques[j].milli, milli) << "tick " << k << ", joint " << j;
      ASSERT_EQ(torques[j].tick, static_cast<std::uint8_t>(k + 1));
      ASSERT_EQ(torques[j].status & ~torque_status::at_limit, torque_status::fresh | torque_status::enabled);
    }
  }
  EXPECT_EQ(counted(bench, Counter::ticks), ticks);
  for (const Counter none : {Counter::stale_ticks, Counter::missing_setpoints, Counter::lost_received,
                             Counter::lost_sent, Counter::foreign_frames})
    EXPECT_EQ(counted(bench, none), 0u) << static_cast<int>(none);
  EXPECT_TRUE(bench.emergencies().empty());
  bench.expect_clean();
}
INSTANTIATE_TEST_SUITE_P(ClassicAndFd, Ticks, testing::Bool(),
                         [](const auto& with) { return with.param ? "Fd" : "Classic"; });

TEST(Node, ComputesWhileTickBusyIsHighAndStaysWithinItsStack) {
  Bench bench;
  bench.start();
  for (std::size_t k = 0; k < 20; ++k) bench.tick(test::motion(k));
  const auto& edges = bench.board.port_b.edges;
  std::vector<GpioPort::Edge> busy;
  for (const auto& edge : edges)
    if (edge.pin == 6) busy.push_back(edge);
  ASSERT_EQ(busy.size() % 2, 1u);  // the first is where the pin becomes an output
  EXPECT_FALSE(busy[0].level);
  ASSERT_GE(busy.size(), 41u);
  for (std::size_t i = 1; i + 1 < busy.size(); i += 2) {
    EXPECT_TRUE(busy[i].level);
    EXPECT_FALSE(busy[i + 1].level);
    EXPECT_LT(busy[i + 1].at - busy[i].at, 250 * microsecond);
  }
  const Image& image = node_image();
  const Address end = image.symbol("fxdyn_stack_end"), begin = end - image.symbol("fxdyn_stack_size");
  const Address lowest = bench.board.lowest_written(begin, end);
  RecordProperty("stack_bytes", static_cast<int>(end - lowest));
  EXPECT_GT(lowest, begin) << "the stack is full";
  EXPECT_LT(lowest, end) << "no stack at all";
  bench.expect_clean();
}

TEST(Node, RampsWhenEnableFalls) {
  Bench bench;
  bench.start();
  std::size_t k = 0;
  for (; k < 20; ++k) bench.tick(test::motion(k));
  bench.board.port_b.drive(4, false);
  bench.tick(test::motion(k++));
  const auto torques = bench.tick(test::motion(k++));
  ASSERT_EQ(torques.size(), test::robot_joints);
  for (const WireTorque& torque : torques) {
    EXPECT_EQ(torque.status & torque_status::enabled, 0);
    EXPECT_EQ(torque.milli, 0);  // no ramp configured
  }
  // A broken wire is pulled low by the pin itself.
  bench.board.port_b.drive(4, true);
  bench.tick(test::motion(k++));
  EXPECT_NE(bench.tick(test::motion(k++))[0].status & torque_status::enabled, 0);
  bench.board.port_b.drive(4, std::nullopt);
  bench.tick(test::motion(k++));
  EXPECT_EQ(bench.tick(test::motion(k++))[0].status & torque_status::enabled, 0);
  bench.expect_clean();
}

TEST(Node, LetsOnlyThroughWhatItListensTo) {
  Bench bench;
  ASSERT_TRUE(bench.boot());
  const auto interrupts = [&] {
    const auto& taken = bench.board.core.taken();
    return std::count(taken.begin(), taken.end(), Core::first_interrupt + 21);
  };
  bench.board.core.forget_taken();
  for (const std::uint32_t id : {0x100u, 0x17fu, 0x187u, 0x207u, 0x300u, 0x582u, 0x602u, 0x7e5u})
    bench.send(id, {1, 2});
  Frame extended = Bench::frame(0x201, {1});
  extended.extended = true;
  bench.send(extended);
  bench.run_ms(5);
  EXPECT_EQ(interrupts(), 0);
  for (const std::uint32_t id : {0x000u, 0x080u, 0x201u, 0x206u, 0x601u, 0x77fu}) {
    bench.board.core.forget_taken();
    bench.send(id, {0xff, 0xff});  // nothing that means anything
    bench.run_ms(1);
    EXPECT_EQ(interrupts(), 1) << std::hex << id;
  }
  bench.expect_clean();
}

TEST(Node, FollowsAnIdentifierThatMoves) {
  Bench bench;
  ASSERT_TRUE(bench.boot());
  ASSERT_TRUE(bench.write(0x1005, 0, 0x090, 4));
  ASSERT_TRUE(bench.write(0x2010, 0, 0, 2));
  bench.nmt(NmtCommand::start);
  bench.heard();
  bench.send_setpoints(test::motion(0));
  bench.send(0x080, {});
  bench.run_ms(2);
  EXPECT_TRUE(bench.torques().empty());
  bench.send(0x090, {});
  bench.run_ms(2);
  EXPECT_EQ(bench.torques().size(), test::robot_joints);
  bench.expect_clean();
}

TEST(Node, AnswersWhileTheBusIsFull) {
  Bench bench;
  bench.start();
  std::size_t k = 0;
  for (; k < 100; ++k) {
    if (k % 10 == 5) bench.send(0x601, Bench::initiate(0x40, 0x1018, 2));
    ASSERT_EQ(bench.tick(test::motion(k)).size(), test::robot_joints) << k;
  }
  EXPECT_EQ(counted(bench, Counter::ticks), k);
  EXPECT_EQ(counted(bench, Counter::stale_ticks), 0u);
  bench.expect_clean();
}

TEST(Node, ATorqueDoesNotWaitBehindAHeartbeat) {
  Bench bench;
  bench.start();
  ASSERT_TRUE(
      bench.board.run_until([&] { return !Bench::take(bench.board.wire.heard, 0x701).empty(); }, 200 * millisecond));
  bench.run_ms(99);
  bench.heard();
  // The next heartbeat finds a bus full of frames that are more urgent than it, and less than a torque.
  const auto flood = [&](int frames) {
    for (int i = 0; i < frames; ++i) bench.send(0x300, {1, 2, 3, 4, 5, 6, 7, 8});
  };
  flood(16);
  bench.send_setpoints(test::motion(0));
  bench.sync();
  flood(40);
  bench.run_ms(20);
  const auto heard = bench.heard();
  const auto at = [&](std::uint32_t id) {
    const auto found = std::find_if(heard.begin(), heard.end(), [&](const auto& h) { return h.frame.id == id; });
    return found == heard.end() ? never : found->at;
  };
  ASSERT_NE(at(0x186), never);
  EXPECT_LT(at(0x186), at(0x701));
  EXPECT_NE(at(0x701), never);
  bench.expect_clean();
}

TEST(Node, TellsWhatATickCosts) {
  Bench bench;
  bench.start();
  for (std::size_t k = 0; k < 20; ++k) bench.tick(test::motion(k));
  const auto most = bench.read(0x2002, 2);
  ASSERT_TRUE(most);
  // At 2 cycles an instruction, as Core counts; the tests on QEMU hold the instructions.
  EXPECT_GT(*most, 2 * 8'000u);
  EXPECT_LT(*most, 2 * 15'000u);
  EXPECT_EQ(bench.text(0x2002, 5), "cycles");
}

// Every place where an interrupt may come between two instructions is as good as any other: the frames' arrival is
// shifted against the tick by a few cycles, and nothing is lost or different.
TEST(Node, DoesNotDependOnWhenFramesComeBetweenItsInstructions) {
  Bench bench;
  bench.start();
  test::Reference reference;
  for (std::size_t k = 0; k < 60; ++k) {
    const auto setpoints = test::motion(k);
    const auto expected = reference.tick(setpoints);
    bench.heard();
    bench.send_setpoints(setpoints);
    bench.sync();
    // Foreign frames that the filters let through, while the tick computes.
    for (int i = 0; i < 3; ++i) bench.send(0x70a, {5});
    bench.board.run(2 * millisecond + k * 37'000'003);
    const auto torques = bench.torques();
    ASSERT_EQ(torques.size(), test::robot_joints) << k;
    for (std::size_t j = 0; j < test::robot_joints; ++j)
      ASSERT_EQ(torques[j].milli, test::on_wire(expected[static_cast<int>(j)].raw, j).second) << k << ", " << j;
  }
  EXPECT_EQ(counted(bench, Counter::lost_received), 0u);
  bench.expect_clean();
}

}  // namespace
