#include <gtest/gtest.h>

#include "hal/mps2/gpio.hpp"
#include "hal/mps2/timer.hpp"
#include "hal/mps2/uart.hpp"
#include "hal/mps2/watchdog.hpp"
#include "hal/stm32/gpio.hpp"
#include "hal/stm32f4/clock.hpp"
#include "hal/stm32f4/usart.hpp"
#include "hal/stm32f4/watchdog.hpp"
#include "hal/stm32g4/drive_board.hpp"
#include "hal/stm32g4/watchdog.hpp"
#include "hal/zynqmp_r5/clock.hpp"
#include "hal/zynqmp_r5/gpio.hpp"
#include "hal/zynqmp_r5/watchdog.hpp"
#include "hal/zynqmp_r5/xcan.hpp"
#include "tests/hal/models/clock_models.hpp"
#include "tests/hal/models/fdcan_model.hpp"
#include "tests/hal/models/g4_chip_model.hpp"
#include "tests/hal/models/serial_models.hpp"
#include "tests/hal/models/xcan_model.hpp"

extern "C" {
std::uint32_t fxdyn_kept[1];  // on a target the linker script's
}

namespace fxdyn::hal {
namespace {

using test::Modelled;
const std::vector<std::string> none;

// FDCAN ---------------------------------------------------------------------------------------------------------------

constexpr auto fast_timing = stm32g4::BusTimings<1'000'000, 4'000'000>::full_speed;

struct FdcanTest : testing::Test {
  test::FdcanModel model;
  stm32g4::BasicFdcan<Modelled> can{Modelled{&model}};
  void TearDown() override { EXPECT_EQ(model.violations, none); }
  void receive(const FdFrame& frame, std::uint32_t code) {
    model.arrives(frame, code);
    if (model.interrupt()) can.on_receive();
  }
};

TEST_F(FdcanTest, StartsInTheOrderOfTheManualAndAtTheBitRate) {
  ASSERT_EQ(can.start(fast_timing), Status::ok);
  EXPECT_FALSE(model.initialising());
  EXPECT_TRUE(model.fd_enabled());
  EXPECT_EQ(model.bit_rate(84'000'000), 1'000'000U);
  EXPECT_EQ(model.data_bit_rate(84'000'000), 4'000'000U);
  EXPECT_EQ(model.field(0x1c, 25, 7) + 1, fast_timing.nominal.jump_width);
  EXPECT_EQ(model.field(0x0c, 0, 4) + 1, fast_timing.data.jump_width);
  EXPECT_EQ(model.interrupts, std::vector<std::uint32_t>{21});
  EXPECT_GE(model.field(0x80, 2, 2), 2U) << "ANFE: rejected, not into the other FIFO, which nobody reads";
  EXPECT_GE(model.field(0x80, 4, 2), 2U) << "ANFS";
  EXPECT_EQ(model.field(0x80, 16, 5), 28U) << "LSS: every standard filter that there is";
  EXPECT_EQ(model.field(0x80, 24, 4), 8U) << "LSE";
}

TEST_F(FdcanTest, AnInterruptOfBeforeTheStartIsForgotten) {
  ASSERT_EQ(can.start(fast_timing), Status::ok);
  model.arrives({.id = 1}, 0);
  ASSERT_TRUE(model.interrupt());
  ASSERT_EQ(can.start(fast_timing), Status::ok);
  EXPECT_FALSE(model.interrupt());
}

TEST_F(FdcanTest, LengthsOfFdFramesAreThoseOfTheirCodes) {
  ASSERT_EQ(can.start(fast_timing), Status::ok);
  constexpr std::array<std::uint8_t, 16> sizes{0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};  // ISO 11898-1
  for (std::uint32_t code = 0; code < sizes.size(); ++code) {
    FdFrame frame{.id = 1, .fd = true, .size = sizes[code]};
    ASSERT_EQ(can.send(frame), Status::ok) << code;
    EXPECT_EQ(model.transmit()->shape, code << 16 | 0b11U << 20);
    receive(frame, code);
    ASSERT_EQ(can.receive(frame), Status::ok);
    EXPECT_EQ(frame.size, sizes[code]);
  }
}

TEST_F(FdcanTest, TheTransmittersDelayIsCompensatedAtBothDataBitRates) {
  for (const auto& timing : {fast_timing, stm32g4::BusTimings<1'000'000, 2'000'000>::full_speed}) {
    ASSERT_EQ(can.start(timing), Status::ok);
    EXPECT_EQ(model.field(0x0c, 23, 1), 1U) << "TDC";
    EXPECT_EQ(model.field(0x48, 8, 7), timing.data.segment1 + 1) << "TDCO: the sample point, in periods of 84 MHz";
    EXPECT_LE(model.field(0x0c, 16, 5), 1U) << "DBRP: the manual wants a prescaler of 1 or 2";
  }
}

TEST_F(FdcanTest, WithoutAClockItFails) {
  model.clocked = false;
  EXPECT_EQ(can.start(fast_timing), Status::failed);
}

TEST_F(FdcanTest, SlowDataPhaseNeedsNoCompensation) {
  constexpr auto timing = stm32g4::fdcan_timing(84'000'000, 500'000, 500'000);
  static_assert(timing.data.prescaler > 2);
  ASSERT_EQ(can.start(timing), Status::ok);
  EXPECT_EQ(model.field(0x0c, 23, 1), 0U);
}

TEST_F(FdcanTest, SendsEveryKindOfFrame) {
  ASSERT_EQ(can.start(fast_timing), Status::ok);
  ASSERT_EQ(can.send({.id = 0x181, .size = 3, .data = {1, 2, 3, 4}}), Status::ok);
  auto sent = model.transmit();
  ASSERT_TRUE(sent);
  EXPECT_EQ(sent->head, 0x181U << 18);
  EXPECT_EQ(sent->shape, 3U << 16);
  EXPECT_EQ(sent->words[0], 0x00030201U);
  ASSERT_EQ(can.send({.id = 0x12345678, .extended = true, .remote = true, .size = 8}), Status::ok);
  sent = model.transmit();
  EXPECT_EQ(sent->head, 0x12345678U | 1U << 30 | 1U << 29);
  EXPECT_EQ(sent->shape, 8U << 16);
  FdFrame frame{.id = 1, .fd = true, .size = 64};
  for (std::size_t i = 0; i < 64; ++i) frame.data[i] = static_cast<std::uint8_t>(i);
  ASSERT_EQ(can.send(frame), Status::ok);
  sent = model.transmit();
  EXPECT_EQ(sent->shape, 15U << 16 | 0b11U << 20);
  EXPECT_EQ(sent->words[0], 0x03020100U);
  EXPECT_EQ(sent->words[15], 0x3f3e3d3cU);
  for (const unsigned size : {9U, 10U, 63U, 65U}) {
    frame.size = static_cast<std::uint8_t>(size);
    EXPECT_EQ(can.send(frame), Status::failed) << size;
  }
  EXPECT_EQ(can.send({.id = 1, .size = 12}), Status::failed) << "12 bytes are none of classic CAN";
  EXPECT_EQ(can.send({.id = 1, .remote = true, .fd = true}), Status::failed) << "CAN FD has no remote frames";
}

TEST_F(FdcanTest, WhatWaitsGoesOutLowestIdentifierFirst) {
  ASSERT_EQ(can.start(fast_timing), Status::ok);
  const auto send = [&](std::uint32_t id) { return can.send({.id = id}); };
  const auto sent = [&] { return model.transmit().value().head >> 18; };
  ASSERT_EQ(send(0x701), Status::ok);
  ASSERT_EQ(send(0x581), Status::ok);
  ASSERT_EQ(send(0x181), Status::ok);
  EXPECT_EQ(send(0x081), Status::busy) << "three are all there is";
  EXPECT_FALSE(can.has_sent_all());
  EXPECT_EQ(sent(), 0x181U) << "a heartbeat that keeps losing the arbitration does not keep a torque waiting";
  ASSERT_EQ(send(0x182), Status::ok);
  EXPECT_EQ(sent(), 0x182U);
  ASSERT_EQ(send(0x181), Status::ok);
  EXPECT_EQ(sent(), 0x181U);
  EXPECT_EQ(sent(), 0x581U);
  EXPECT_FALSE(can.has_sent_all());
  EXPECT_EQ(sent(), 0x701U);
  EXPECT_EQ(model.waiting(), 0);
  EXPECT_TRUE(can.has_sent_all());
}

TEST_F(FdcanTest, FramesWithOneIdentifierKeepTheirOrder) {
  ASSERT_EQ(can.start(fast_timing), Status::ok);
  const auto torque = [](std::uint8_t tick) { return FdFrame{.id = 0x181, .size = 1, .data = {tick}}; };
  for (const std::uint32_t before : {0U, 1U, 2U}) {  // so many places with a lower number, free again at once
    for (std::uint32_t id = 0; id < before; ++id) ASSERT_EQ(can.send({.id = id}), Status::ok);
    ASSERT_EQ(can.send(torque(1)), Status::ok);
    for (std::uint32_t id = 0; id < before; ++id) ASSERT_EQ(model.transmit()->head >> 18, id);
    EXPECT_EQ(can.send(torque(2)), Status::busy);
    EXPECT_EQ(model.waiting(), 1);
    EXPECT_EQ(can.send({.id = 0x181, .remote = true}), Status::ok) << "another arbitration field";
    EXPECT_EQ(can.send({.id = 0x181 << 18, .extended = true}), Status::ok);
    EXPECT_EQ(model.transmit()->words[0] & 0xff, 1U);
    EXPECT_EQ(can.send(torque(2)), Status::ok);
    EXPECT_EQ(model.transmit()->words[0] & 0xff, 2U);
    EXPECT_NE(model.transmit()->head & 1U << 29, 0U);
    EXPECT_NE(model.transmit()->head & 1U << 30, 0U);
  }
  EXPECT_EQ(model.waiting(), 0);
}

TEST_F(FdcanTest, ReceivesEveryKindOfFrame) {
  ASSERT_EQ(can.start(fast_timing), Status::ok);
  FdFrame frame;
  EXPECT_EQ(can.receive(frame), Status::busy);
  receive({.id = 0x7ff, .size = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}}, 8);
  receive({.id = 0x1fffffff, .extended = true, .remote = true}, 5);
  FdFrame large{.id = 0x201, .fd = true, .size = 48};
  for (std::size_t i = 0; i < 48; ++i) large.data[i] = static_cast<std::uint8_t>(200 + i);
  receive(large, 14);
  receive({.id = 3, .size = 8, .data = {9}}, 15);  // classic frames may have a DLC beyond 8: still 8 bytes
  ASSERT_EQ(can.receive(frame), Status::ok);
  EXPECT_EQ(frame.id, 0x7ffU);
  EXPECT_FALSE(frame.extended || frame.remote || frame.fd);
  EXPECT_EQ(frame.size, 8);
  EXPECT_EQ(frame.data[7], 8);
  ASSERT_EQ(can.receive(frame), Status::ok);
  EXPECT_TRUE(frame.extended && frame.remote);
  EXPECT_EQ(frame.id, 0x1fffffffU);
  EXPECT_EQ(frame.size, 5);
  ASSERT_EQ(can.receive(frame), Status::ok);
  EXPECT_TRUE(frame.fd);
  EXPECT_EQ(frame.size, 48);
  EXPECT_TRUE(std::equal(frame.data.begin(), frame.data.end(), large.data.begin()));
  ASSERT_EQ(can.receive(frame), Status::ok);
  EXPECT_EQ(frame.size, 8);
  EXPECT_EQ(can.receive(frame), Status::busy);
  EXPECT_EQ(can.errors().lost, 0U);
}

TEST_F(FdcanTest, ListensToWhatItIsTold) {
  ASSERT_EQ(can.start(fast_timing), Status::ok);
  const auto heard = [&](const FdFrame& sent) {
    FdFrame frame;
    receive(sent, 0);
    return can.receive(frame) == Status::ok;
  };
  constexpr std::array<IdRange, 3> some{{{0, 0}, {0x201, 0x206}, {0x7f0, 0x7ff}}};
  can.listen(some);
  for (std::uint32_t id = 0; id < 0x800; ++id)
    EXPECT_EQ(heard({.id = id}), id == 0 || (id >= 0x201 && id <= 0x206) || id >= 0x7f0) << id;
  EXPECT_TRUE(heard({.id = 0x203, .remote = true}));
  EXPECT_FALSE(heard({.id = 0x203, .extended = true}));
  can.listen(std::span(some).first(1));
  EXPECT_TRUE(heard({.id = 0}));
  EXPECT_FALSE(heard({.id = 0x201}));
  std::array<IdRange, 29> many;  // one more than there are elements
  for (std::uint32_t i = 0; i < many.size(); ++i) many[i] = {2 * i, 2 * i};
  can.listen(std::span(many).first(28));
  EXPECT_TRUE(heard({.id = 54}));
  EXPECT_FALSE(heard({.id = 56}));
  can.listen(many);
  EXPECT_TRUE(heard({.id = 56}));
  EXPECT_TRUE(heard({.id = 0x7ff}));
}

TEST_F(FdcanTest, OverrunsAreCounted) {
  ASSERT_EQ(can.start(fast_timing), Status::ok);
  for (std::uint32_t id = 0; id < 5; ++id) model.arrives({.id = id}, 0);  // the interrupt comes too late for two
  can.on_receive();
  EXPECT_EQ(can.errors().lost, 1U) << "RF0L tells that some were lost, not how many";
  FdFrame frame;
  for (std::uint32_t id = 0; id < 3; ++id) {
    ASSERT_EQ(can.receive(frame), Status::ok);
    EXPECT_EQ(frame.id, id);
  }
  EXPECT_EQ(can.receive(frame), Status::busy);
  for (std::uint32_t id = 0; id < 20; ++id) receive({.id = id}, 0);  // nobody empties the ring of 16
  EXPECT_EQ(can.errors().lost, 5U);
}

TEST_F(FdcanTest, ARestartWithoutBusOffLosesNothing) {
  ASSERT_EQ(can.start(fast_timing), Status::ok);
  ASSERT_EQ(can.send({.id = 1}), Status::ok);
  EXPECT_EQ(can.restart(), Status::ok);
  EXPECT_EQ(model.waiting(), 1);
}

TEST_F(FdcanTest, BusOffRecoversAfterTheSequencesAndSendsNothingOld) {
  ASSERT_EQ(can.start(fast_timing), Status::ok);
  for (const std::uint32_t id : {0x181U, 0x581U, 0x701U}) ASSERT_EQ(can.send({.id = id}), Status::ok);
  model.set_counters(130, 5);
  EXPECT_EQ(can.errors().state, CanState::passive);
  EXPECT_EQ(can.errors().transmit, 130);
  EXPECT_EQ(can.errors().receive, 5);
  model.set_counters(248, 5);
  model.go_off_the_bus();
  EXPECT_EQ(can.errors().state, CanState::bus_off);
  EXPECT_EQ(can.send({.id = 0x182}), Status::failed);
  FdFrame frame;
  EXPECT_EQ(can.receive(frame), Status::failed);
  model.idle_sequences(1000);
  EXPECT_EQ(can.errors().state, CanState::bus_off) << "nobody has asked for the recovery";
  EXPECT_EQ(can.restart(), Status::busy);
  model.idle_sequences(128);
  EXPECT_EQ(can.restart(), Status::busy);
  EXPECT_EQ(can.send({.id = 0x182}), Status::failed);
  model.idle_sequences(1);
  EXPECT_EQ(can.restart(), Status::ok);
  EXPECT_EQ(can.errors().state, CanState::active);
  EXPECT_EQ(model.waiting(), 0) << "a torque from before";
  ASSERT_EQ(can.send({.id = 0x183}), Status::ok);
  EXPECT_EQ(model.transmit()->head >> 18, 0x183U);
  ASSERT_EQ(can.send({.id = 0x181}), Status::ok) << "no longer waiting, though it never went out";
}

// XCAN ----------------------------------------------------------------------------------------------------------------

constexpr BitTiming xcan_timing =
    bit_timing(zynqmp_r5::can_limits, zynqmp_r5::can_clock_hz, {.bits_per_second = 1'000'000});

template <zynqmp_r5::FrameFormat format>
struct XcanFixture : testing::Test {
  test::XcanModel model;
  test::FakeClock clock;
  zynqmp_r5::BasicXcan<format, test::FakeClock, Modelled> can{clock, Modelled{&model}};
  void TearDown() override { EXPECT_EQ(model.violations, none); }
  void sends_and_receives(const ClassicFrame& frame, const test::XcanModel::Words& words) {
    ASSERT_EQ(can.send(frame), Status::ok);
    ASSERT_EQ(model.sent.size(), 1U);
    EXPECT_EQ(model.sent.front(), words);
    model.arrives(model.sent.front());
    model.sent.clear();
    ClassicFrame back;
    ASSERT_EQ(can.receive(back), Status::ok);
    EXPECT_EQ(back.id, frame.id);
    EXPECT_EQ(back.extended, frame.extended);
    EXPECT_EQ(back.remote, frame.remote);
    EXPECT_EQ(back.size, frame.size);
    EXPECT_EQ(back.data, frame.data);
    EXPECT_EQ(can.receive(back), Status::busy);
  }
};
using XcanTest = XcanFixture<zynqmp_r5::FrameFormat::controller>;
using XcanInQemu = XcanFixture<zynqmp_r5::FrameFormat::qemu_7>;

TEST_F(XcanTest, StartsAtTheBitRate) {
  ASSERT_EQ(can.start(xcan_timing, 1000), Status::ok);
  const std::uint32_t btr = model.value(0x0c);
  EXPECT_EQ(100'000'000 / ((model.value(0x08) + 1) * (1 + (btr & 0xf) + 1 + (btr >> 4 & 7) + 1)), 1'000'000U);
  EXPECT_FALSE(model.configuring());
}

TEST_F(XcanTest, AStuckControllerFails) {
  model.stuck = true;
  EXPECT_EQ(can.start(xcan_timing, 1000), Status::failed);
}

TEST_F(XcanTest, FramesStandAsInTheManual) {
  ASSERT_EQ(can.start(xcan_timing, 1000), Status::ok);
  sends_and_receives({.id = 0x181, .size = 5, .data = {1, 2, 3, 4, 5}},
                     {0x181U << 21, 5U << 28, 0x01020304, 0x05000000});
  sends_and_receives({.id = 0x701, .remote = true}, {0x701U << 21 | 1U << 20, 0, 0, 0});
  sends_and_receives({.id = 0x1fffffff, .extended = true, .size = 1, .data = {0xaa}},
                     {0xfffffffeU, 1U << 28, 0xaa000000, 0});
  sends_and_receives({.id = 0x40001, .extended = true, .remote = true, .size = 2},
                     {1U << 21 | 0b11U << 19 | 1U << 1 | 1U, 2U << 28, 0, 0});
  EXPECT_EQ(can.send({.id = 1, .fd = true}), Status::failed);
}

TEST_F(XcanInQemu, FramesStandAsInItsModel) {
  ASSERT_EQ(can.start(xcan_timing, 1000), Status::ok);
  sends_and_receives({.id = 0x181, .size = 5, .data = {1, 2, 3, 4, 5}}, {0x181, 5U << 28, 0x04030201, 0x00000005});
  sends_and_receives({.id = 0x182}, {0x182, 0, 0, 0});  // an identifier whose lowest bit is 0
  sends_and_receives({.id = 0x1fffffff, .extended = true, .remote = true}, {0xdfffffffU, 0, 0, 0});
}

TEST_F(XcanTest, FullFifosAreBusyAndCounted) {
  ASSERT_EQ(can.start(xcan_timing, 1000), Status::ok);
  model.fill_transmit_fifo();
  EXPECT_EQ(can.send({.id = 1}), Status::busy);
  model.drain_transmit_fifo();
  EXPECT_EQ(can.send({.id = 1}), Status::ok);
  for (std::uint32_t id = 0; id < 70; ++id) model.arrives({id << 21, 0, 0, 0});
  ClassicFrame frame;
  for (std::uint32_t id = 0; id < 64; ++id) {
    ASSERT_EQ(can.receive(frame), Status::ok);
    EXPECT_EQ(frame.id, id);
  }
  EXPECT_EQ(can.receive(frame), Status::busy);
  EXPECT_EQ(can.errors().lost, 1U) << "the flag tells that some were lost, not how many";
}

TEST_F(XcanTest, BusOffPassesTheTimeOf128Times11Bits) {
  ASSERT_EQ(can.start(xcan_timing, 1000), Status::ok);
  EXPECT_EQ(can.restart(), Status::ok);
  model.set_counters(130, 3);
  EXPECT_EQ(can.errors().state, CanState::passive);
  EXPECT_EQ(can.errors().transmit, 130);
  model.set_counters(256, 3);
  EXPECT_EQ(can.errors().state, CanState::bus_off);
  EXPECT_EQ(can.send({.id = 1}), Status::failed);
  EXPECT_EQ(can.restart(), Status::busy);
  EXPECT_TRUE(model.configuring()) << "off the bus while it waits";
  clock.us += 1407;
  EXPECT_EQ(can.restart(), Status::busy);
  EXPECT_EQ(can.errors().state, CanState::bus_off);
  EXPECT_EQ(can.send({.id = 1}), Status::failed);
  clock.us += 1;
  EXPECT_EQ(can.restart(), Status::ok);
  EXPECT_EQ(can.errors().state, CanState::active);
  EXPECT_EQ(can.send({.id = 1}), Status::ok);
}

// Serial lines --------------------------------------------------------------------------------------------------------

TEST(CmsdkUart, ReceivesWhatTheInterruptBringsAndLosesNoByteThatComesBetween) {
  test::CmsdkUartModel model(mps2::uart0_address);
  mps2::BasicUart<Modelled> uart{Modelled{&model}};
  uart.start();
  std::string text;
  const auto interrupts = [&] {
    while (model.interrupt()) uart.on_receive();
  };
  for (int i = 0; i < 3000; ++i) {
    model.byte_comes_between = i % 7 == 0;
    const auto byte = static_cast<std::uint8_t>('a' + i % 26);
    ASSERT_TRUE(model.arrives(byte)) << i;
    text += static_cast<char>(byte);
    if (i % 7 == 0) text += '!';
    interrupts();
    if (i % 500 != 499) continue;
    std::array<std::uint8_t, 1024> bytes;
    const std::size_t count = uart.read(bytes);
    ASSERT_EQ(std::string(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count)), text);
    text.clear();
  }
  for (int i = 0; i < 2000; ++i) {
    EXPECT_TRUE(model.arrives('x'));
    interrupts();
  }
  std::array<std::uint8_t, 2048> bytes;
  EXPECT_EQ(uart.read(bytes), 1024U) << "what the ring holds";
  EXPECT_EQ(model.violations, none);
}

TEST(CmsdkUart, StopsWhereTheTransmitterIsFull) {
  test::CmsdkUartModel model(mps2::uart0_address);
  mps2::BasicUart<Modelled> uart{Modelled{&model}};
  uart.start();
  const std::array<std::uint8_t, 3> bytes{1, 2, 3};
  EXPECT_EQ(uart.write(bytes), 3U);
  model.transmit_full = true;
  EXPECT_EQ(uart.write(bytes), 0U);
  EXPECT_EQ(model.sent, (std::vector<std::uint8_t>{1, 2, 3}));
  EXPECT_EQ(model.violations, none);
}

TEST(Usart, ReceivesAndSendsAndGetsOverAnOverrun) {
  test::UsartModel model;
  stm32f4::BasicUsart<Modelled> usart{Modelled{&model}};
  usart.start({stm32::ClockSource::internal_slow, 16});
  EXPECT_EQ(model.read(test::UsartModel::base + 0x08), 17U) << "16 MHz / 921600 = 17.4";
  EXPECT_EQ(model.interrupts, std::vector<std::uint32_t>{37});
  model.arrives('a');
  model.arrives('b');  // too early: lost, and ORE set
  while (model.interrupt()) usart.on_receive();
  model.arrives('c');
  while (model.interrupt()) usart.on_receive();
  std::array<std::uint8_t, 8> bytes{};
  ASSERT_EQ(usart.read(bytes), 2U);
  EXPECT_EQ(bytes[0], 'a');
  EXPECT_EQ(bytes[1], 'c');
  const std::array<std::uint8_t, 2> out{'x', 'y'};
  EXPECT_EQ(usart.write(out), 2U);
  model.transmit_full = true;
  EXPECT_EQ(usart.write(out), 0U);
  EXPECT_EQ(model.violations, none);
}

// Clocks --------------------------------------------------------------------------------------------------------------

template <class Part>
struct Clocks;
template <>
struct Clocks<test::G4> {
  static stm32::SystemClock start(Modelled registers) { return stm32g4::start_clock(registers); }
};
template <>
struct Clocks<test::F4> {
  static stm32::SystemClock start(Modelled registers) { return stm32f4::start_clock(registers); }
};
template <class Part>
struct Rcc : testing::Test {
  test::RccModel<Part> model;
  stm32::SystemClock start() { return Clocks<Part>::start(Modelled{&model}); }
  void TearDown() override { EXPECT_EQ(model.violations, none); }
};
using Parts = testing::Types<test::G4, test::F4>;
TYPED_TEST_SUITE(Rcc, Parts);

TYPED_TEST(Rcc, RunsFromTheCrystal) {
  const stm32::SystemClock clock = this->start();
  EXPECT_EQ(clock.source, stm32::ClockSource::crystal);
  EXPECT_EQ(clock.mhz, TypeParam::full_mhz);
  EXPECT_DOUBLE_EQ(this->model.mhz(), TypeParam::full_mhz);
}
TYPED_TEST(Rcc, WithoutACrystalItRunsFromTheInternalOscillator) {
  this->model.crystal_starts = false;
  const stm32::SystemClock clock = this->start();
  EXPECT_EQ(clock.source, stm32::ClockSource::internal);
  EXPECT_EQ(clock.mhz, TypeParam::full_mhz);
  EXPECT_DOUBLE_EQ(this->model.mhz(), TypeParam::full_mhz);
}
TYPED_TEST(Rcc, WithoutAPllItStaysSlow) {
  this->model.pll_locks = false;
  for (const bool crystal : {true, false}) {
    this->model.crystal_starts = crystal;
    const stm32::SystemClock clock = this->start();
    EXPECT_EQ(clock.source, stm32::ClockSource::internal_slow);
    EXPECT_EQ(clock.mhz, 16U);
    EXPECT_DOUBLE_EQ(this->model.mhz(), 16);
  }
}

TEST(Rcc, TheDebugPortOfTheG4StaysOpen) {
  test::RccModel<test::G4> model;
  EXPECT_EQ(stm32g4::start_clock(Modelled{&model}).mhz, 168U);
  EXPECT_EQ(model.read(test::G4::flash), 4U | 0b110U << 8 | 1U << 18) << "wait states, caches, DBG_SWEN";
}

TEST(Rcc, RegistersThatReadAsZeroEndWithTheInternalOscillator) {
  struct Nothing {
    std::uint32_t read(Address) const { return 0; }
    void write(Address, std::uint32_t) const {}
  };
  EXPECT_EQ(stm32f4::start_clock(Nothing{}).source, stm32::ClockSource::internal_slow);
  EXPECT_EQ(stm32g4::start_clock(Nothing{}).source, stm32::ClockSource::internal_slow);
}

// Watchdogs -----------------------------------------------------------------------------------------------------------

template <class Tested>
class Iwdg : public testing::Test {};
using Watchdogs = testing::Types<stm32g4::BasicWatchdog<Modelled>, stm32f4::BasicWatchdog<Modelled>>;
TYPED_TEST_SUITE(Iwdg, Watchdogs);

template <class Tested>
constexpr stm32::LsiRange range =
    std::is_same_v<Tested, stm32g4::BasicWatchdog<Modelled>> ? stm32g4::lsi : stm32f4::lsi;

TYPED_TEST(Iwdg, ResetsUnlessFed) {
  test::IwdgModel model;
  TypeParam watchdog{Modelled{&model}};
  EXPECT_EQ(watchdog.start(0), Status::failed);
  EXPECT_EQ(watchdog.start(TypeParam::most_ms + 1), Status::failed);
  EXPECT_FALSE(model.running());
  ASSERT_EQ(watchdog.start(TypeParam::most_ms), Status::ok);
  ASSERT_EQ(watchdog.start(20), Status::ok);
  for (int i = 0; i < 100; ++i) {
    model.pass_ms(19);
    watchdog.feed();
  }
  EXPECT_FALSE(model.has_reset);
  model.pass_ms(TypeParam::longest_ms(20) * range<TypeParam>.lowest_hz / 32'000.0 + 0.1);
  EXPECT_TRUE(model.has_reset);
  EXPECT_EQ(model.violations, none);
}

template <class Tested, std::uint32_t asked>
void holds_over_the_whole_range_of_its_oscillator() {
  constexpr std::uint32_t longest = Tested::longest_ms(asked);
  for (const double hz : {double(range<Tested>.lowest_hz), 32'000.0, double(range<Tested>.highest_hz)}) {
    for (const double first_count : {1e-9, 1.0}) {
      test::IwdgModel model;
      model.lsi_khz = hz / 1000;
      model.first_count = first_count;
      Tested watchdog{Modelled{&model}};
      ASSERT_EQ(watchdog.start(asked), Status::ok);
      model.pass_ms(asked);
      EXPECT_FALSE(model.has_reset) << "sooner than " << asked << " ms, LSI " << hz << " Hz";
      model.pass_ms(longest - asked + 1e-6);
      EXPECT_TRUE(model.has_reset) << "later than " << longest << " ms, LSI " << hz << " Hz";
    }
  }
}
TYPED_TEST(Iwdg, ItsTimeHoldsOverTheWholeRangeOfItsOscillator) {
  holds_over_the_whole_range_of_its_oscillator<TypeParam, 1>();
  holds_over_the_whole_range_of_its_oscillator<TypeParam, 4>();
  holds_over_the_whole_range_of_its_oscillator<TypeParam, 50>();
}

// What the guide says.
static_assert(stm32g4::Watchdog::longest_ms(50) == 62 && stm32f4::Watchdog::longest_ms(50) == 142);
static_assert(stm32::BasicWatchdog<stm32::LsiRange{4'000, 4'000}>::longest_ms(50) == 51, "51 counts of 1 ms each");
static_assert(stm32g4::lsi.lowest_hz <= 29'500 && stm32g4::lsi.highest_hz >= 34'000, "DS12288");
static_assert(stm32f4::lsi.lowest_hz <= 17'000 && stm32f4::lsi.highest_hz >= 47'000, "DS8626");

TEST(CmsdkWatchdog, IsUnlockedForEveryWriteAndLockedAfterIt) {
  test::PlainModel model;
  mps2::BasicWatchdog<Modelled> watchdog{Modelled{&model}};
  watchdog.start(100'000);
  watchdog.feed();
  bool open = false;
  for (const auto& [address, value] : model.writes) {
    if (address == 0x4000'8c00) {
      open = value == 0x1acc'e551;
    } else {
      EXPECT_TRUE(open) << std::hex << address;
    }
  }
  EXPECT_FALSE(open);
  EXPECT_EQ(model.at(0x4000'8000), 2'500'000U);
  EXPECT_EQ(model.at(0x4000'8008), 0b11U);
}

TEST(CmsdkWatchdog, ItsResetIsToldOnce) {
  test::PlainModel model;
  mps2::BasicWatchdog<Modelled> watchdog{Modelled{&model}};
  EXPECT_FALSE(watchdog.made_the_reset());
  watchdog.on_time_out();
  EXPECT_TRUE(watchdog.made_the_reset());
  EXPECT_FALSE(watchdog.made_the_reset());
}

TEST(Swdt, TimesOutUnlessFed) {
  test::SwdtModel model;
  zynqmp_r5::BasicWatchdog<Modelled> watchdog{Modelled{&model}};
  EXPECT_EQ(watchdog.start(0), Status::failed);
  EXPECT_EQ(watchdog.start(10'738), Status::failed);
  EXPECT_FALSE(model.running());
  for (const std::uint32_t timeout_ms : {1U, 50U, 10'737U}) {
    ASSERT_EQ(watchdog.start(timeout_ms), Status::ok);
    for (int i = 0; i < 100; ++i) {
      model.pass_ms(timeout_ms - 0.01);
      watchdog.feed();
    }
    EXPECT_FALSE(model.has_timed_out) << timeout_ms;
  }
  ASSERT_EQ(watchdog.start(50), Status::ok);
  model.pass_ms(50 + 2.63);
  EXPECT_TRUE(model.has_timed_out);
  EXPECT_EQ(model.violations, none);
  model.clocked = false;
  EXPECT_EQ(watchdog.start(50), Status::failed);
}

// Timers --------------------------------------------------------------------------------------------------------------

TEST(Timers, CountThePeriodsThatTheirInterruptsTell) {
  test::PlainModel model;
  mps2::BasicTimer<Modelled> cmsdk{Modelled{&model}};
  EXPECT_EQ(cmsdk.start(0), Status::failed);
  EXPECT_EQ(cmsdk.start(400'000'000), Status::failed);
  ASSERT_EQ(cmsdk.start(1000), Status::ok);
  EXPECT_EQ(model.at(0x4000'0008), 24'999U);
  EXPECT_EQ(cmsdk.expired(), 0U);
  for (int i = 0; i < 3; ++i) cmsdk.on_interrupt();
  EXPECT_EQ(cmsdk.expired(), 3U);
  EXPECT_EQ(cmsdk.expired(), 0U);

  test::PlainModel stm;
  stm32g4::BasicTimer<Modelled> tim{Modelled{&stm}};
  tim.set_clock({stm32::ClockSource::crystal, 168});
  EXPECT_EQ(tim.start(70'000), Status::failed);
  ASSERT_EQ(tim.start(2000), Status::ok);
  EXPECT_EQ(stm.at(stm32g4::tim6 + 0x28), 167U);
  EXPECT_EQ(stm.at(stm32g4::tim6 + 0x2c), 1999U);
  EXPECT_EQ(stm.interrupts, std::vector<std::uint32_t>{54});
  tim.on_interrupt();
  EXPECT_EQ(tim.expired(), 1U);
}

TEST(Clock, SysTickCountsDownAndTtcUp) {
  test::PlainModel model;
  stm32f4::BasicMicrosecondClock<Modelled> systick({stm32::ClockSource::crystal, 168}, Modelled{&model});
  model.at(0xe000'e018) = 0x00ff'ffff - 167;  // 168 periods on
  EXPECT_NEAR(systick.now_us(), 1, 1);
  model.at(0xe000'e018) = 0x00ff'ffff - 168 * 50'000;
  EXPECT_NEAR(systick.now_us(), 50'000, 1);

  test::PlainModel ttc;
  zynqmp_r5::BasicMicrosecondClock<Modelled> clock{Modelled{&ttc}};
  ttc.at(zynqmp_r5::ttc0 + 0x18) = 62'500;
  EXPECT_NEAR(clock.now_us(), 40'000, 1);
  ttc.at(zynqmp_r5::ttc0 + 0x18) = (62'500 + 15'625) & 0xffff;
  EXPECT_NEAR(clock.now_us(), 50'000, 1);
}

// Pins ----------------------------------------------------------------------------------------------------------------

TEST(Pins, OutputsAreOffBeforeTheyAreDriven) {
  test::PlainModel stm;
  stm32::OutputPin<stm32g4::gpio_b, 5, true, Modelled> fault{Modelled{&stm}};
  ASSERT_GE(stm.writes.size(), 2U);
  EXPECT_EQ(stm.writes.front(), (std::pair<Address, std::uint32_t>{stm32g4::gpio_b + 0x18, 1U << 21}));
  EXPECT_EQ(stm.at(stm32g4::gpio_b) >> 10 & 0b11, 1U);
  EXPECT_EQ(fault.set(true), Status::ok);
  EXPECT_EQ(stm.at(stm32g4::gpio_b + 0x18), 1U << 5);

  test::PlainModel cmsdk;
  mps2::OutputPin<9, false, Modelled> inverted{Modelled{&cmsdk}};
  ASSERT_EQ(cmsdk.writes.size(), 2U);
  EXPECT_EQ(cmsdk.writes[0], (std::pair<Address, std::uint32_t>{0x4001'0000 + 0x800 + 4 * 2, 1U << 9}));
  EXPECT_EQ(inverted.set(true), Status::ok);
  EXPECT_EQ(cmsdk.at(0x4001'0808), 0U);

  test::PlainModel zynq;
  zynqmp_r5::OutputPin<20, true, Modelled> pin{Modelled{&zynq}};
  EXPECT_EQ(pin.set(true), Status::ok);
  EXPECT_EQ(zynq.at(zynqmp_r5::gpio + 0x4), 0xffef'0010U);
  EXPECT_EQ(zynq.at(zynqmp_r5::gpio + 0x208), 1U << 20);
}

TEST(Pins, AnOutputMayBeAssertedFromTheStart) {
  test::PlainModel stm, cmsdk, zynq;
  stm32::OutputPin<stm32g4::gpio_b, 5, false, Modelled> on_stm{AtStart::on, Modelled{&stm}};
  EXPECT_EQ(stm.writes.front(), (std::pair<Address, std::uint32_t>{stm32g4::gpio_b + 0x18, 1U << 21}));
  mps2::OutputPin<2, false, Modelled> on_mps2{AtStart::on, Modelled{&cmsdk}};
  EXPECT_EQ(cmsdk.writes.front(), (std::pair<Address, std::uint32_t>{0x4001'0000 + 0x400 + 4 * (1 << 2), 0}));
  zynqmp_r5::OutputPin<14, false, Modelled> on_zynq{AtStart::on, Modelled{&zynq}};
  EXPECT_EQ(zynq.writes.front(), (std::pair<Address, std::uint32_t>{zynqmp_r5::gpio, 0xbfff'0000U}));
}

TEST(Pins, InputsReadTheirLevelByPolarity) {
  test::PlainModel stm;
  stm.at(stm32g4::gpio_b) = 0xffff'ffff;  // after reset: analog
  stm32::InputPin<stm32g4::gpio_b, 4, true, Modelled> enable{Modelled{&stm}};
  EXPECT_EQ(stm.at(stm32g4::gpio_b), 0xffff'ffffU & ~(3U << 8));
  EXPECT_EQ(stm.at(stm32g4::gpio_b + 0x0c) >> 8 & 0b11, 2U) << "pulled down: a broken wire is off";
  bool on = true;
  EXPECT_EQ(enable.read(on), Status::ok);
  EXPECT_FALSE(on);
  stm.at(stm32g4::gpio_b + 0x10) = 1U << 4;
  EXPECT_EQ(enable.read(on), Status::ok);
  EXPECT_TRUE(on);

  test::PlainModel cmsdk;
  mps2::InputPin<1, false, Modelled> low{Modelled{&cmsdk}};
  EXPECT_EQ(low.read(on), Status::ok);
  EXPECT_TRUE(on);
}

TEST(Pins, AlternateFunctionsGoToTheirRegister) {
  test::PlainModel stm;
  Modelled registers{&stm};
  stm32::use_alternate_function(registers, stm32g4::gpio_a, 11, 9);
  EXPECT_EQ(stm.at(stm32g4::gpio_a + 0x24), 9U << 12);
  EXPECT_EQ(stm.at(stm32g4::gpio_a) >> 22 & 0b11, 2U);
}

// The STM32G474 of a drive, from its reset to the bus ----------------------------------------------------------------

struct DriveBoardTest : testing::Test {
  test::G4ChipModel chip;
  std::optional<stm32g4::DriveBoard<Modelled>> board;
  stm32g4::BasicFdcan<Modelled> can{Modelled{&chip}};
  using Bus = stm32g4::BusTimings<1'000'000, 2'000'000>;
  Status start() {
    board.emplace(Modelled{&chip});
    return can.start(Bus::of(board->system));
  }
  void TearDown() override {
    EXPECT_EQ(chip.violations, none);
    EXPECT_EQ(chip.can.violations, none);
  }
};

TEST_F(DriveBoardTest, ReachesTheBusAtItsBitRates) {
  ASSERT_EQ(start(), Status::ok);
  EXPECT_EQ(board->system.source, stm32::ClockSource::crystal);
  EXPECT_DOUBLE_EQ(chip.mhz(), 168);
  EXPECT_DOUBLE_EQ(chip.can_mhz(), 84);
  EXPECT_EQ(chip.can.bit_rate(84'000'000), 1'000'000U);
  EXPECT_EQ(chip.can.data_bit_rate(84'000'000), 2'000'000U);
  EXPECT_DOUBLE_EQ(chip.counts_mhz(), 1) << "a count of the clock is a microsecond";
  EXPECT_EQ(chip.read(stm32g4::tim2 + 0x2c), UINT32_MAX) << "and it wraps with 32 bits";
}

TEST_F(DriveBoardTest, TheBitRateStaysWithoutCrystal) {
  chip.crystal_starts = false;
  ASSERT_EQ(start(), Status::ok);
  EXPECT_EQ(board->system.source, stm32::ClockSource::internal);
  EXPECT_DOUBLE_EQ(chip.can_mhz(), 84);
  EXPECT_EQ(chip.can.bit_rate(84'000'000), 1'000'000U);
  EXPECT_DOUBLE_EQ(chip.counts_mhz(), 1);
}

TEST_F(DriveBoardTest, TheBitRateStaysWithoutPll) {
  chip.pll_locks = false;
  ASSERT_EQ(start(), Status::ok);
  EXPECT_EQ(board->system.source, stm32::ClockSource::internal_slow);
  EXPECT_DOUBLE_EQ(chip.can_mhz(), 16);
  EXPECT_EQ(chip.can.bit_rate(16'000'000), 1'000'000U);
  EXPECT_EQ(chip.can.data_bit_rate(16'000'000), 2'000'000U);
  EXPECT_DOUBLE_EQ(chip.counts_mhz(), 1);
}

TEST_F(DriveBoardTest, PinsAreWhatTheGuideSays) {
  ASSERT_EQ(start(), Status::ok);
  for (const std::uint32_t pin : {11U, 12U}) {  // data sheet, "Alternate function": FDCAN1_RX, FDCAN1_TX
    EXPECT_EQ(chip.mode(stm32g4::gpio_a, pin), 2U);
    EXPECT_EQ(chip.function(stm32g4::gpio_a, pin), 9U);
  }
  for (const std::uint32_t pin : {13U, 14U}) EXPECT_EQ(chip.mode(stm32g4::gpio_a, pin), 2U) << "SWD stays open";
  EXPECT_EQ(chip.mode(stm32g4::gpio_b, 4), 0U) << "not NJTRST any more";
  EXPECT_EQ(chip.pull(stm32g4::gpio_b, 4), 2U) << "down: a broken wire is off";
  bool on = true;
  EXPECT_EQ(board->enable.read(on), Status::ok);
  EXPECT_FALSE(on);
  chip.outside(stm32g4::gpio_b, 4, true);
  EXPECT_EQ(board->enable.read(on), Status::ok);
  EXPECT_TRUE(on);
  EXPECT_TRUE(chip.driven_low(stm32g4::gpio_b, 6)) << "no tick";
  EXPECT_EQ(board->tick_busy.set(true), Status::ok);
  EXPECT_TRUE(chip.driven_high(stm32g4::gpio_b, 6));
}

TEST_F(DriveBoardTest, ItIsFaultyUntilSomebodySaysOtherwise) {
  EXPECT_FALSE(chip.driven_high(stm32g4::gpio_b, 5)) << "in reset";
  ASSERT_EQ(start(), Status::ok);
  EXPECT_TRUE(chip.driven_low(stm32g4::gpio_b, 5));
  EXPECT_EQ(board->fault.set(false), Status::ok);
  EXPECT_TRUE(chip.driven_high(stm32g4::gpio_b, 5));
  EXPECT_EQ(board->fault.set(true), Status::ok);
  EXPECT_TRUE(chip.driven_low(stm32g4::gpio_b, 5));
}

TEST_F(DriveBoardTest, ResetsByTheWatchdogAreToldOnce) {
  chip.reset_flags(1U << 29 | 1U << 26);  // IWDGRSTF, PINRSTF
  EXPECT_TRUE(stm32g4::DriveBoard<Modelled>(Modelled{&chip}).watchdog_reset);
  test::G4ChipModel other;
  other.reset_flags(1U << 26);
  EXPECT_FALSE(stm32g4::DriveBoard<Modelled>(Modelled{&other}).watchdog_reset);
  EXPECT_FALSE(stm32g4::reset_by_watchdog(Modelled{&chip})) << "the next reset is another one's";
}

TEST_F(DriveBoardTest, TheWakeUpTimerHasItsClock) {
  ASSERT_EQ(start(), Status::ok);
  stm32g4::BasicTimer<Modelled> timer{Modelled{&chip}};
  timer.set_clock(board->system);
  ASSERT_EQ(timer.start(500), Status::ok);
  EXPECT_EQ(chip.read(stm32g4::tim6 + 0x28), 167U);
}

}  // namespace
}  // namespace fxdyn::hal
