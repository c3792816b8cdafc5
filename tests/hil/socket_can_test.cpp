// SocketCAN on virtual interfaces (vcan0 with, vcan1 without CAN FD, vcan2 down) and, in the guest, on two controllers
// of type SJA1000 joined by a bus (can0, can1). on_can.sh makes them.

#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <cstdlib>
#include <numeric>

#include "hal/linux/clock.hpp"
#include "hal/linux/socket_can.hpp"

namespace fxdyn::hal::linux {
namespace {

using Classic = SocketCan<ClassicFrame>;
using Fd = SocketCan<FdFrame>;

/// As descriptor() asks for it: what has been taken from the kernel with an earlier frame is not waited for.
template <class Bus>
Status receive_within(Bus& bus, typename Bus::Frame& frame, int milliseconds) {
  if (const Status status = bus.receive(frame); status != Status::busy) return status;
  pollfd wait{bus.descriptor(), POLLIN, 0};
  ::poll(&wait, 1, milliseconds);
  return bus.receive(frame);
}

TEST(SocketCan, CarriesClassicFramesOfAllKinds) {
  Classic a, b;
  ASSERT_TRUE(a.open("vcan0"));
  ASSERT_TRUE(b.open("vcan0"));
  ClassicFrame frame;
  EXPECT_EQ(b.receive(frame), Status::busy);
  for (const auto& sent :
       {ClassicFrame{.id = 0x181, .size = 8, .data = {1, 2, 3, 4, 5, 6, 7, 255}}, ClassicFrame{.id = 0x80},
        ClassicFrame{.id = 0x1abcdef0, .extended = true, .size = 3, .data = {9, 8, 7}},
        ClassicFrame{.id = 0x701, .remote = true}}) {
    ASSERT_EQ(a.send(sent), Status::ok);
    ASSERT_EQ(receive_within(b, frame, 1000), Status::ok);
    EXPECT_EQ(frame.id, sent.id);
    EXPECT_EQ(frame.extended, sent.extended);
    EXPECT_EQ(frame.remote, sent.remote);
    EXPECT_FALSE(frame.fd);
    ASSERT_EQ(frame.size, sent.size);
    EXPECT_TRUE(std::equal(sent.data.begin(), sent.data.begin() + sent.size, frame.data.begin()));
  }
  EXPECT_EQ(a.receive(frame), Status::busy) << "its own frames do not come back";
}

TEST(SocketCan, CarriesFdFramesBesideClassicOnes) {
  Fd a, b;
  Classic classic;
  ASSERT_TRUE(a.open("vcan0"));
  ASSERT_TRUE(b.open("vcan0"));
  ASSERT_TRUE(classic.open("vcan0"));
  FdFrame sent{.id = 0x201, .fd = true, .size = 48};
  std::iota(sent.data.begin(), sent.data.end(), std::uint8_t{1});
  ASSERT_EQ(a.send(sent), Status::ok);
  ASSERT_EQ(a.send({.id = 0x80}), Status::ok);
  FdFrame frame;
  ASSERT_EQ(receive_within(b, frame, 1000), Status::ok);
  EXPECT_TRUE(frame.fd);
  EXPECT_EQ(frame.size, 48);
  EXPECT_TRUE(std::equal(sent.data.begin(), sent.data.begin() + 48, frame.data.begin()));
  ASSERT_EQ(receive_within(b, frame, 1000), Status::ok);
  EXPECT_FALSE(frame.fd);
  ClassicFrame only;
  ASSERT_EQ(receive_within(classic, only, 1000), Status::ok);
  EXPECT_EQ(only.id, 0x80U) << "a classic socket sees no FD frame";
}

TEST(SocketCan, FiltersInTheKernel) {
  Classic a, b;
  const can_filter setpoints{0x200, 0x780};
  ASSERT_TRUE(a.open("vcan0"));
  ASSERT_TRUE(b.open("vcan0", std::span{&setpoints, 1}));
  ASSERT_EQ(a.send({.id = 0x181}), Status::ok);
  ASSERT_EQ(a.send({.id = 0x203}), Status::ok);
  ClassicFrame frame;
  ASSERT_EQ(receive_within(b, frame, 1000), Status::ok);
  EXPECT_EQ(frame.id, 0x203U);
  EXPECT_EQ(b.receive(frame), Status::busy);
}

TEST(SocketCan, StampsFrames) {
  Classic a, b;
  ASSERT_TRUE(a.open("vcan0"));
  ASSERT_TRUE(b.open("vcan0"));
  const auto now = [] {
    timespec t{};
    ::clock_gettime(CLOCK_REALTIME, &t);
    return t.tv_sec * 1'000'000'000LL + t.tv_nsec;
  };
  // the kernel switches its time stamps on a moment after the first socket has asked for them
  ::usleep(100'000);
  const auto before = now();
  ASSERT_EQ(a.send({.id = 1}), Status::ok);
  const auto after = now();
  ::usleep(20'000);
  ClassicFrame frame;
  ASSERT_EQ(b.receive(frame), Status::ok);
  EXPECT_GE(b.received_ns(), before);
  EXPECT_LE(b.received_ns(), after + 10'000'000) << "when it came, not when it was read";
}

TEST(SocketCan, CountsWhatTheKernelDropped) {
  Classic a, b;
  ASSERT_TRUE(a.open("vcan0"));
  ASSERT_TRUE(b.open("vcan0"));
  const int small = 4096;
  ASSERT_EQ(::setsockopt(b.descriptor(), SOL_SOCKET, SO_RCVBUF, &small, sizeof small), 0);
  constexpr std::uint32_t sent = 500;
  for (std::uint32_t i = 0; i < sent; ++i) {
    while (a.send({.id = 0x123}) == Status::busy) ::usleep(100);
  }
  ::usleep(50'000);
  ClassicFrame frame;
  std::uint32_t received = 0;
  while (b.receive(frame) == Status::ok) ++received;
  ASSERT_LT(received, sent);
  EXPECT_EQ(b.errors().lost, 0U) << "the kernel says it with the next frame";
  ASSERT_EQ(a.send({.id = 0x124}), Status::ok);
  ASSERT_EQ(receive_within(b, frame, 1000), Status::ok);
  EXPECT_EQ(b.errors().lost, sent - received);
}

/// An error frame as a driver makes it; a virtual interface lets any program send one.
void error_frame(std::uint32_t id, std::uint8_t controller, std::uint8_t transmit, std::uint8_t receive) {
  const int socket = ::socket(AF_CAN, SOCK_RAW, CAN_RAW);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex("vcan0"));
  ASSERT_EQ(::bind(socket, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  can_frame frame{};
  frame.can_id = CAN_ERR_FLAG | id;
  frame.len = CAN_ERR_DLC;
  frame.data[1] = controller;
  frame.data[6] = transmit;
  frame.data[7] = receive;
  ASSERT_EQ(::write(socket, &frame, sizeof frame), static_cast<ssize_t>(sizeof frame));
  ::close(socket);
}

TEST(SocketCan, ReadsStatesFromErrorFrames) {
  Classic bus;
  ASSERT_TRUE(bus.open("vcan0"));
  ClassicFrame frame;
  EXPECT_EQ(bus.errors().state, CanState::active);
  error_frame(CAN_ERR_CRTL | CAN_ERR_CNT, CAN_ERR_CRTL_TX_PASSIVE, 128, 3);
  EXPECT_EQ(receive_within(bus, frame, 200), Status::busy);
  EXPECT_EQ(bus.errors().state, CanState::passive);
  EXPECT_EQ(bus.errors().transmit, 128);
  EXPECT_EQ(bus.errors().receive, 3);
  EXPECT_NE(explain(bus.errors(), "can0", 500'000)
                .find("not the bit rate of the bus, here 500000: sudo ip link set can0 down && sudo ip link set can0 "
                      "up type can "
                      "bitrate"),
            std::string::npos);
  error_frame(CAN_ERR_BUSOFF, 0, 0, 0);
  EXPECT_EQ(receive_within(bus, frame, 200), Status::busy);
  EXPECT_EQ(bus.errors().state, CanState::bus_off);
  EXPECT_EQ(bus.send({.id = 1}), Status::failed);
  EXPECT_NE(explain(bus.errors(), "can0", 0).find("ip link set can0 type can restart"), std::string::npos);
  error_frame(CAN_ERR_RESTARTED, 0, 0, 0);
  EXPECT_EQ(receive_within(bus, frame, 200), Status::busy);
  EXPECT_EQ(bus.errors().state, CanState::active);
  EXPECT_EQ(bus.send({.id = 1}), Status::ok);
}

TEST(SocketCan, LeavesBusOffOnceTheKernelHas) {
  Classic bus;
  ASSERT_TRUE(bus.open("vcan0"));
  ClassicFrame frame;
  error_frame(CAN_ERR_BUSOFF, 0, 0, 0);
  EXPECT_EQ(receive_within(bus, frame, 200), Status::busy);
  // a virtual interface is never off the bus, so the kernel says that it is active
  EXPECT_EQ(bus.restart(), Status::ok);
  EXPECT_EQ(bus.send({.id = 1}), Status::ok);
}

struct BadInterface {
  const char* name;
  CanOpenError error;
  const char* remedy;
};

TEST(SocketCan, SaysWhatIsWrongAndHowToPutItRight) {
  for (const auto& bad : {BadInterface{"can9", CanOpenError::no_interface, "ip link add can9 type vcan"},
                          BadInterface{"an_interface_name_that_is_too_long", CanOpenError::no_interface, "ip -br link"},
                          BadInterface{"lo", CanOpenError::not_can, "ip -br link show type can"},
                          BadInterface{"vcan2", CanOpenError::down, "ip link set vcan2 up type can bitrate 1000000"}}) {
    Classic bus;
    const CanOpenResult result = bus.open(bad.name);
    EXPECT_EQ(result.error, bad.error) << bad.name;
    EXPECT_NE(explain(result, bad.name).find(bad.remedy), std::string::npos) << explain(result, bad.name);
    EXPECT_EQ(explain(result, bad.name).find('\n'), std::string::npos);
    ClassicFrame frame;
    EXPECT_EQ(bus.send({.id = 1}), Status::failed);
    EXPECT_EQ(bus.receive(frame), Status::failed);
  }
  Fd bus;
  const CanOpenResult result = bus.open("vcan1");
  EXPECT_EQ(result.error, CanOpenError::not_fd);
  EXPECT_NE(explain(result, "vcan1").find("ip link set vcan1 mtu 72"), std::string::npos);
}

TEST(SocketCan, TellsOfAnInterfaceThatGoesDown) {
  Classic a, b;
  ASSERT_TRUE(a.open("vcan1"));
  ASSERT_EQ(std::system("ip link set vcan1 down"), 0);
  ClassicFrame frame;
  EXPECT_EQ(a.receive(frame), Status::failed);
  EXPECT_EQ(a.receive(frame), Status::busy) << "said once";
  EXPECT_EQ(a.send({.id = 1}), Status::failed);
  ASSERT_EQ(std::system("ip link set vcan1 up"), 0);
  ASSERT_TRUE(b.open("vcan1"));
  EXPECT_EQ(a.send({.id = 1}), Status::ok) << "the same socket goes on";
  EXPECT_EQ(receive_within(b, frame, 1000), Status::ok);
}

TEST(SocketCan, ReadsBitRateAndStateOfAController) {
  CanLink link;
  if (query_link("can0", link) != 0) GTEST_SKIP() << "no CAN controller here";
  EXPECT_TRUE(link.controlled);
  EXPECT_EQ(link.bit_rate, 1'000'000U);
  EXPECT_EQ(link.state, CanState::active);
  EXPECT_FALSE(link.fd);
  Classic a, b;
  ASSERT_TRUE(a.open("can0"));
  ASSERT_TRUE(b.open("can1"));
  ASSERT_EQ(a.send({.id = 0x7ff, .size = 2, .data = {1, 2}}), Status::ok);
  ClassicFrame frame;
  ASSERT_EQ(receive_within(b, frame, 1000), Status::ok);
  EXPECT_EQ(frame.id, 0x7ffU);
  EXPECT_EQ(a.restart(), Status::ok) << "it is on the bus";
  Fd fd;
  EXPECT_EQ(fd.open("can0").error, CanOpenError::not_fd);
}

TEST(TickTimer, CountsPeriods) {
  TickTimer timer;
  EXPECT_EQ(timer.expired(), 0U);
  ASSERT_EQ(timer.start(10'000), Status::ok);
  EXPECT_EQ(timer.expired(), 0U);
  const Clock clock;
  const std::uint32_t begin = clock.now_us();
  ::usleep(105'000);
  const std::uint32_t count = timer.expired();
  const std::uint32_t after = clock.now_us() - begin;
  EXPECT_GE(count, 10U);
  EXPECT_LE(count, after / 10'000 + 1);
  ASSERT_EQ(timer.start(0), Status::ok);
  ::usleep(30'000);
  EXPECT_EQ(timer.expired(), 0U) << "stopped";
}

TEST(CycleCounter, GrowsWithWork) {
  CycleCounter counter;
  const auto work = [&](int rounds) {
    volatile int sum = 0;
    counter.start();
    for (int i = 0; i < rounds; ++i) sum = sum + i;
    return counter.stop();
  };
  EXPECT_GT(work(10'000'000), work(1000));
}

TEST(Watchdog, SaysThatThereIsNone) {
  Watchdog none;
  none.feed();
  EXPECT_FALSE(none.armed());
  EXPECT_EQ(none.open("/nonexistent/watchdog", 1), Status::failed);
  EXPECT_FALSE(none.armed());
}

}  // namespace
}  // namespace fxdyn::hal::linux
