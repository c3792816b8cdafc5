// What the node makes of a board whose parts do not start, and what it asks of a bus with acceptance filters.

#include "tests/firmware/node_bench.hpp"

namespace fxdyn {
namespace {

using canopen::Abort;
using canopen::NmtCommand;
using canopen::NmtState;
using dictionary::Counter;
using test::Bench;
using Codes = std::vector<std::uint16_t>;

TEST(DriveNodeHardware, WhatFailsAtTheStartIsAFaultThatLasts) {
  Bench<> bench({.board = "bench", .hardware_failed = hardware_part::can | hardware_part::watchdog});
  bench.node.poll();
  EXPECT_TRUE(bench.on_wire.fault.level) << "after the first look at the bus";
  bench.pass(1000);
  EXPECT_EQ(bench.emergencies(), (Codes{0x5000}));
  EXPECT_EQ(bench.read(0x1003, 1), 0x0005'5000U) << "which parts";
  EXPECT_EQ(bench.read(0x1001), 1U);
  bench.pass(1'000'000);
  EXPECT_TRUE(bench.on_wire.fault.level);
  bench.nmt(NmtCommand::reset_node);
  bench.pass(1000);
  EXPECT_TRUE(bench.on_wire.fault.level) << "a reset by NMT repairs nothing";
  EXPECT_EQ(bench.read(0x1001), 1U);
}

TEST(DriveNodeHardware, ABoardThatIsWellShowsNoFault) {
  Bench<> bench;
  bench.pass(1000);
  EXPECT_FALSE(bench.on_wire.fault.level);
  EXPECT_EQ(bench.emergencies(), Codes{});
}

/// A controller that hears only what it was told to listen to.
class FilteringController : public hal::fake::CanController<hal::ClassicFrame> {
 public:
  using CanController::CanController;
  bool sent_all = true;
  bool has_sent_all() { return sent_all; }
  void listen(std::span<const hal::IdRange> ranges) { ranges_.assign(ranges.begin(), ranges.end()); }
  bool hears(std::uint32_t id) const {
    return std::any_of(ranges_.begin(), ranges_.end(),
                       [&](const auto& range) { return id >= range.first && id <= range.last; });
  }
  hal::Status receive(hal::ClassicFrame& frame) {
    hal::Status status;
    do {
      status = CanController::receive(frame);
    } while (status == hal::Status::ok && (frame.extended || !hears(frame.id)));
    return status;
  }

 private:
  std::vector<hal::IdRange> ranges_;
};
static_assert(hal::FilteringCanBus<FilteringController> && hal::SortingCanBus<FilteringController>);

/// The first joint's drive on a bus with filters.
struct FilteredNode : testing::Test {
  using Model = test::OneJoint<test::Robot, 0>::type;
  using Hardware = DriveHardware<FilteringController, hal::fake::Clock, hal::fake::CycleCounter, hal::fake::Watchdog,
                                 hal::fake::InputPin, hal::fake::OutputPin, hal::fake::OutputPin>;
  static constexpr RatedTorques<Model> rated{test::rated};
  hal::fake::Clock clock;
  hal::fake::CanWire<hal::ClassicFrame> wire{clock};
  hal::fake::CanController<hal::ClassicFrame> host{wire};
  FilteringController bus{wire};
  hal::fake::CycleCounter counter;
  hal::fake::Watchdog watchdog{clock, 50'000};
  hal::fake::InputPin enable{true};
  hal::fake::OutputPin fault, tick_busy;
  Hardware hardware{bus, clock, counter, watchdog, enable, fault, tick_busy};
  Model::Parameters parameters = test::OneJoint<test::Robot, 0>::parameters(tables::page.parameters);
  DriveNode<Model, Hardware> node{
      hardware, {parameters, {table_magic, Model::layout_hash(), 0, 0}, true, UpdateSlot::empty, rated}, {}};

  void send(std::uint32_t id, const test::Bytes& bytes) {
    ASSERT_EQ(host.send(Bench<>::frame(id, bytes)), hal::Status::ok);
    while (node.poll()) continue;
  }
  void write(std::uint32_t index, std::uint8_t sub, std::uint32_t value) {
    for (hal::ClassicFrame old; host.receive(old) == hal::Status::ok;) continue;
    send(0x601, Bench<>::initiate(0x23, index, sub, value));
    hal::ClassicFrame answer;
    ASSERT_EQ(host.receive(answer), hal::Status::ok);
    ASSERT_EQ(answer.data[0], 0x60) << std::hex << index << ':' << int{sub};
  }
};

// A bus that sends the lowest identifier first would send the error ahead of the boot-up message.
TEST_F(FilteredNode, AnErrorWaitsUntilTheBootUpMessageIsOut) {
  const auto sent = [&] {
    std::vector<std::uint32_t> ids;
    for (const auto& frame : std::exchange(wire.sent, {})) ids.push_back(frame.id);
    return ids;
  };
  using Ids = std::vector<std::uint32_t>;
  bus.sent_all = false;
  send(0x080, {1});  // an error: SYNC with data
  send(0x080, {1});
  EXPECT_EQ(sent(), (Ids{0x080, 0x701, 0x080}));
  bus.sent_all = true;
  while (node.poll()) continue;
  EXPECT_EQ(sent(), Ids{0x081});
  // What waits later has nothing to do with it.
  bus.sent_all = false;
  clock.advance(50'000);
  while (node.poll()) continue;
  clock.advance(100'000);
  while (node.poll()) continue;
  EXPECT_EQ(sent(), (Ids{0x081, 0x701})) << "the error is gone; a heartbeat";
  // But a reset makes a new boot-up message.
  send(0, {0x81, 1});
  send(0x080, {1});
  EXPECT_EQ(sent(), (Ids{0, 0x701, 0x080}));
}

TEST_F(FilteredNode, ListensToWhatItHandlesAndNothingElse) {
  while (node.poll()) continue;
  for (std::uint32_t id = 0; id < 0x800; ++id) {
    const bool wanted = id == 0 || id == 0x80 || (id >= 0x201 && id <= 0x206) || id == 0x601 ||  //
                        id == 0x81 || id == 0x181 || id == 0x581 ||  // another node's, with its id
                        (id > 0x700 && id <= 0x77f);
    EXPECT_EQ(bus.hears(id), wanted) << std::hex << id;
  }
  send(0x581, {1});
  EXPECT_EQ(node.counted(Counter::id_collisions), 1U);
}

TEST_F(FilteredNode, FollowsIdentifiersThatMove) {
  while (node.poll()) continue;
  write(0x1402, 1, 0x8000'0203);  // the setpoint of joint 3 goes to where other nodes have their torques
  EXPECT_FALSE(bus.hears(0x203));
  write(0x1402, 1, 0x1a3);
  write(0x1005, 0, 0x100);
  EXPECT_TRUE(bus.hears(0x1a3));
  EXPECT_TRUE(bus.hears(0x100));
  EXPECT_FALSE(bus.hears(0x80));
  send(0, {1, 1});
  ASSERT_EQ(node.state(), NmtState::operational);
  const auto setpoints = test::motion(0);
  for (std::uint32_t j = 0; j < 6; ++j) send(j == 2 ? 0x1a3 : 0x201 + j, Bench<>::bytes_of(setpoints[j]));
  send(0x100, {});
  EXPECT_EQ(node.counted(Counter::ticks), 1U);
  send(0, {0x81, 1});  // reset: the defaults again
  while (node.poll()) continue;
  EXPECT_TRUE(bus.hears(0x203));
  EXPECT_FALSE(bus.hears(0x1a3));
}

}  // namespace
}  // namespace fxdyn
