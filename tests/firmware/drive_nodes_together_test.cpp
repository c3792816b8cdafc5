// Six nodes with one joint each on one bus, against one node with all six.

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <tuple>

#include "tests/firmware/node_bench.hpp"

namespace fxdyn {
namespace {

using canopen::NmtState;
using dictionary::Counter;
using test::Robot;

template <std::size_t j>
using Drive = typename test::OneJoint<Robot, j>::type;
template <std::size_t j>
const auto drive_parameters = test::OneJoint<Robot, j>::parameters(tables::page.parameters);

/// Six drives on one wire.
template <class Frame>
struct Drives {
  explicit Drives(hal::fake::CanWire<Frame>& wire, hal::fake::Clock& clock)
      : d0(wire, clock, drive_parameters<0>),
        d1(wire, clock, drive_parameters<1>),
        d2(wire, clock, drive_parameters<2>),
        d3(wire, clock, drive_parameters<3>),
        d4(wire, clock, drive_parameters<4>),
        d5(wire, clock, drive_parameters<5>) {}
  test::NodeOnWire<Frame, Drive<0>> d0;
  test::NodeOnWire<Frame, Drive<1>> d1;
  test::NodeOnWire<Frame, Drive<2>> d2;
  test::NodeOnWire<Frame, Drive<3>> d3;
  test::NodeOnWire<Frame, Drive<4>> d4;
  test::NodeOnWire<Frame, Drive<5>> d5;

  template <class Visit>
  void each(Visit&& visit) {
    std::apply([&](auto&... d) { (visit(d), ...); }, std::tie(d0, d1, d2, d3, d4, d5));
  }
  void poll() {
    bool more = true;
    for (int i = 0; more; ++i) {
      ASSERT_LT(i, 10'000);
      more = false;
      each([&](auto& d) { more = d.node.poll() || more; });
    }
  }
};

/// A host on a wire.
template <class Frame>
struct Wire {
  hal::fake::Clock clock;
  hal::fake::CanWire<Frame> wire{clock};
  hal::fake::CanController<Frame> host{wire};

  void send(std::uint32_t id, const test::Bytes& bytes) {
    ASSERT_EQ(host.send(test::Bench<Frame>::frame(id, bytes)), hal::Status::ok);
  }
  std::map<std::uint32_t, test::Bytes> heard() {
    std::map<std::uint32_t, test::Bytes> frames;
    for (Frame f; host.receive(f) == hal::Status::ok;)
      frames[f.id] = test::Bytes(f.data.begin(), f.data.begin() + f.size);
    return frames;
  }
};

TEST(DriveNodesTogether, LookLikeOneNode) {
  test::Bench<> whole;
  whole.start();
  Wire<hal::ClassicFrame> bus;
  Drives<hal::ClassicFrame> drives(bus.wire, bus.clock);
  drives.poll();
  EXPECT_EQ(bus.heard().size(), 6U);  // boot-ups, each with an id of its own
  bus.send(0, {0x01, 0x00});
  drives.poll();
  drives.each([](auto& d) { EXPECT_EQ(d.node.state(), NmtState::operational); });

  std::mt19937 random(1);
  std::uint32_t left_out = 0;
  for (std::size_t k = 0; k < 2000; ++k) {
    const auto setpoints = test::motion(k);
    const std::size_t missing = random() % 20;
    left_out += missing < 6 ? 1 : 0;
    for (std::size_t j = 0; j < 6; ++j) {
      if (j == missing) continue;
      whole.send_setpoint(j, setpoints[j]);
      bus.send(0x201 + static_cast<std::uint32_t>(j), whole.bytes_of(setpoints[j]));
    }
    whole.sync();
    bus.wire.sent.clear();
    bus.send(0x80, {});
    drives.poll();
    std::map<std::uint32_t, test::Bytes> expected;
    for (const auto& f : whole.heard()) {
      if (f.id >= 0x180) expected[f.id] = test::Bytes(f.data.begin(), f.data.begin() + f.size);
    }
    auto got = bus.heard();
    std::erase_if(got, [](const auto& entry) { return entry.first < 0x180 || entry.first > 0x700; });
    std::erase_if(expected, [](const auto& entry) { return entry.first > 0x700; });
    ASSERT_EQ(got.size(), 6U);
    ASSERT_EQ(got, expected) << "tick " << k;
    whole.pass(2000);
    for (int i = 0; i < 4; ++i) {
      bus.clock.advance(500);
      drives.poll();
    }
  }
  EXPECT_EQ(whole.counted(Counter::stale_ticks), left_out);
  drives.each([&](auto& d) {
    EXPECT_EQ(d.node.counted(Counter::stale_ticks), left_out);
    EXPECT_EQ(d.node.counted(Counter::id_collisions), 0U);
    EXPECT_EQ(d.node.counted(Counter::lost_sent), 0U);
  });
}

TEST(DriveNodesTogether, EachShowsItsOwnJointInTheDictionary) {
  hal::fake::Clock clock;
  hal::fake::CanWire<hal::ClassicFrame> wire(clock);
  test::NodeOnWire<hal::ClassicFrame, Drive<3>> drive(wire, clock, drive_parameters<3>);
  EXPECT_EQ(drive.node.id(), 4);
  dictionary::Object object;
  EXPECT_EQ(drive.node.find(0x1803, 1, object), canopen::Abort::none);
  std::array<std::uint8_t, 32> bytes{};
  EXPECT_EQ(drive.node.read(object, bytes.data()), 4U);
  EXPECT_EQ(canopen::load<4>(bytes.data()), 0x4000'0184U);
  EXPECT_EQ(drive.node.find(0x1800, 1, object), canopen::Abort::no_object);
  EXPECT_EQ(drive.node.find(0x1405, 1, object), canopen::Abort::none);
}

TEST(DriveNodesTogether, WithCanFdOneFrameEach) {
  Wire<hal::FdFrame> bus;
  Drives<hal::FdFrame> drives(bus.wire, bus.clock);
  drives.poll();
  for (std::uint32_t id = 1; id <= 6; ++id) {
    bus.send(0x600 + id, {0x2F, 0x30, 0x20, 0x00, 1, 0, 0, 0});
    bus.send(0x600 + id, {0x2B, 0x10, 0x20, 0x00, 0, 0, 0, 0});  // no ramp
  }
  drives.poll();
  bus.send(0, {0x01, 0x00});
  test::Reference reference;
  for (std::size_t k = 0; k < 300; ++k) {
    const auto setpoints = test::motion(k);
    test::Bytes all(48);
    for (std::size_t j = 0; j < 6; ++j) setpoints[j].store(&all[8 * j]);
    drives.poll();
    bus.heard();
    bus.wire.sent.clear();
    bus.send(0x201, all);
    bus.send(0x80, {});
    drives.poll();
    EXPECT_EQ(bus.wire.sent.size(), 8U);
    auto got = bus.heard();
    const auto expected = reference.tick(setpoints);
    for (std::size_t j = 0; j < 6; ++j) {
      const auto torque = WireTorque::load(got.at(0x181 + static_cast<std::uint32_t>(j)).data());
      const auto [per_mille, milli] = test::on_wire(expected[static_cast<int>(j)].raw, j);
      ASSERT_EQ(torque.per_mille, per_mille);
      ASSERT_EQ(torque.milli, milli);
    }
    bus.clock.advance(2000);
  }
}

}  // namespace
}  // namespace fxdyn
