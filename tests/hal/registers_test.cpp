// What the drivers of the simple peripherals write, word for word as the manuals have it, and the parts that drivers
// share. Addresses and values stand here once more, so that a slip of a digit in a driver shows.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "hal/absent.hpp"
#include "hal/can.hpp"
#include "hal/cortex_m/core.hpp"
#include "hal/mps2/gpio.hpp"
#include "hal/mps2/timer.hpp"
#include "hal/mps2/uart.hpp"
#include "hal/mps2/watchdog.hpp"
#include "hal/polled.hpp"
#include "hal/ring.hpp"
#include "hal/stm32/gpio.hpp"
#include "hal/stm32f4/clock.hpp"
#include "hal/stm32f4/usart.hpp"
#include "hal/stm32g4/clock.hpp"
#include "hal/stm32g4/fdcan.hpp"
#include "hal/stm32g4/timer.hpp"
#include "hal/zynqmp_r5/clock.hpp"
#include "hal/zynqmp_r5/gpio.hpp"
#include "hal/zynqmp_r5/watchdog.hpp"
#include "hal/zynqmp_r5/xcan.hpp"
#include "tests/hal/models/clock_models.hpp"
#include "tests/hal/models/fdcan_model.hpp"
#include "tests/hal/models/xcan_model.hpp"

extern "C" {
std::uint32_t fxdyn_kept[1];  // on a target the linker script's
}

namespace fxdyn::hal {
namespace {

using test::Modelled;
using Writes = std::vector<std::pair<Address, std::uint32_t>>;

// Shared parts --------------------------------------------------------------------------------------------------------

TEST(Registers, BitsAndFieldsKeepTheirNeighbours) {
  test::PlainModel model;
  Modelled registers{&model};
  model.at(8) = 0xffff'0000;
  set_bits(registers, 8, 0x0f);
  EXPECT_EQ(model.at(8), 0xffff'000fU);
  clear_bits(registers, 8, 0x8000'0001);
  EXPECT_EQ(model.at(8), 0x7fff'000eU);
  set_field(registers, 8, 0xff00'0000, 0x1200'0000);
  EXPECT_EQ(model.at(8), 0x12ff'000eU);
}

/// Reads as `value` from the n-th read on.
struct Later {
  std::uint32_t value = 0, before = 0;
  std::uint32_t ready_at = 1;
  std::uint32_t* reads;
  std::uint32_t read(Address) const { return ++*reads >= ready_at ? value : before; }
  void write(Address, std::uint32_t) const {}
};

TEST(Registers, WaitingLooksExactlySoOften) {
  for (const bool cleared : {false, true}) {
    std::uint32_t reads = 0;
    Later late{.value = cleared ? 0U : 0b11U, .before = 0b01, .ready_at = 5, .reads = &reads};
    EXPECT_TRUE(wait_for(late, 0, 0b11, 5, cleared));
    EXPECT_EQ(reads, 5U);
    reads = 0;
    EXPECT_FALSE(wait_for(late, 0, 0b11, 4, cleared)) << "one bit of two is not enough";
    EXPECT_EQ(reads, 4U);
  }
}

TEST(Registers, AnInterruptIsLetThroughByItsNumber) {
  for (const std::uint32_t number : {0U, 1U, 31U, 32U, 54U, 63U, 101U}) {
    test::PlainModel model;
    Modelled registers{&model};
    cortex_m::enable_interrupt(registers, number);
    EXPECT_EQ(model.interrupts, std::vector<std::uint32_t>{number});
  }
}

TEST(Ring, HoldsAsManyAsItSaysInTheirOrderAroundItsEnd) {
  Ring<std::uint32_t, 8> ring;
  std::uint32_t in = 0, out = 0, item = 0;
  for (std::uint32_t round = 0; round < 50; ++round) {
    EXPECT_TRUE(ring.empty());
    EXPECT_FALSE(ring.pop(item));
    for (std::uint32_t i = 0; i < 8; ++i) ASSERT_TRUE(ring.push(in++));
    EXPECT_FALSE(ring.push(999)) << "full";
    EXPECT_FALSE(ring.empty());
    const std::uint32_t alone = round % 8;  // moves the place where the rest begins
    for (std::uint32_t i = 0; i < alone; ++i) {
      ASSERT_TRUE(ring.pop(item));
      EXPECT_EQ(item, out++);
    }
    std::array<std::uint32_t, 5> some{77, 77, 77, 77, 77};
    const std::size_t expected = std::min<std::size_t>(5, 8 - alone);
    ASSERT_EQ(ring.pop(std::span(some)), expected);
    for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(some[i], i < expected ? out++ : 77U);
    while (ring.pop(item)) EXPECT_EQ(item, out++);
    EXPECT_EQ(out, in);
    EXPECT_EQ(ring.pop(std::span(some)), 0U);
    for (std::uint32_t i = 0; i < 3; ++i) ASSERT_TRUE(ring.push(in++));
    out += 3;
    std::array<std::uint32_t, 16> many{};
    EXPECT_EQ(ring.pop(std::span(many)), 3U);
    EXPECT_EQ(many[2], in - 1);
  }
}

TEST(Polled, MicrosecondsAddUpWhatTheCounterWentOn) {
  constexpr Microseconds<16>::Rate third(3);
  EXPECT_EQ(third.us_per_count, ((std::uint64_t{1'000'000} << 32) + 1) / 3) << "rounded";
  EXPECT_EQ((Microseconds<16>::Rate(7).us_per_count), (std::uint64_t{1'000'000} << 32) / 7 + 1) << ".571: upwards";
  Microseconds<16> time(Microseconds<16>::Rate(500'000));  // 2 us a count
  EXPECT_EQ(time.now(0), 0U);
  EXPECT_EQ(time.now(10), 20U);
  EXPECT_EQ(time.now(0xffff), 2 * 0xffffU);
  EXPECT_EQ(time.now(4), 2 * 0x1'0004U) << "wrapped at 16 bits";
  Microseconds<24> wide(Microseconds<24>::Rate(1'000'000));
  EXPECT_EQ(wide.now(0x1'0000), 0x1'0000U);
  EXPECT_EQ(wide.now(0x5), 0x100'0005U) << "wrapped at 24 bits";
}

TEST(Polled, TheTimerCountsWholePeriodsAndNothingBeforeItsStart) {
  test::FakeClock clock{.us = 0xffff'ff00};
  PolledTimer timer(clock);
  EXPECT_EQ(timer.expired(), 0U);
  EXPECT_EQ(timer.start(0), Status::failed);
  EXPECT_EQ(timer.expired(), 0U);
  ASSERT_EQ(timer.start(100), Status::ok);
  EXPECT_EQ(timer.expired(), 0U);
  clock.us += 99;
  EXPECT_EQ(timer.expired(), 0U);
  clock.us += 1;
  EXPECT_EQ(timer.expired(), 1U);
  EXPECT_EQ(timer.expired(), 0U);
  clock.us += 350;  // over the wrap
  EXPECT_EQ(timer.expired(), 3U);
  clock.us += 50;
  EXPECT_EQ(timer.expired(), 1U) << "what was left counts";
}

TEST(Can, LengthsOfFdFramesAreThoseOfADlc) {
  const std::set<std::size_t> lengths{0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
  for (std::size_t bytes = 0; bytes <= 64; ++bytes) EXPECT_EQ(fd_length(bytes), *lengths.lower_bound(bytes)) << bytes;
}

TEST(Absent, PartsSayThatAllIsWell) {
  bool on = false;
  EXPECT_EQ(FixedInput{}.read(on), Status::ok);
  EXPECT_TRUE(on) << "a drive without the input is enabled";
  EXPECT_EQ(FixedInput{false}.read(on), Status::ok);
  EXPECT_FALSE(on);
  EXPECT_EQ(AbsentOutput{}.set(true), Status::ok);
  EXPECT_EQ(AbsentCycleCounter{}.stop(), 0U);
}

void fields_hold(const BitTimingLimits& limits, int prescaler_bits, int segment1_bits, int segment2_bits,
                 int jump_bits) {
  EXPECT_EQ(limits.largest_prescaler, 1U << prescaler_bits);
  EXPECT_EQ(limits.largest_segment1, 1U << segment1_bits);
  EXPECT_EQ(limits.largest_segment2, 1U << segment2_bits);
  EXPECT_EQ(limits.largest_jump_width, 1U << jump_bits);
}
TEST(Can, BitTimingsEndWhereTheirFieldsDo) {
  fields_hold(stm32g4::nominal_limits, 9, 8, 7, 7);  // NBTP: NBRP, NTSEG1, NTSEG2, NSJW
  fields_hold(stm32g4::data_limits, 5, 5, 4, 4);     // DBTP: DBRP, DTSEG1, DTSEG2, DSJW
  fields_hold(zynqmp_r5::can_limits, 8, 4, 3, 2);    // BRPR; BTR: TS1, TS2, SJW
}

// Cortex-M ------------------------------------------------------------------------------------------------------------

TEST(CycleCounter, IsTheDwtsAndLeavesTheOtherBits) {
  test::PlainModel model;
  model.at(0xe000'edfc) = 0x1;          // DEMCR
  model.at(0xe000'1000) = 0x4000'0000;  // DWT_CTRL: number of comparators
  cortex_m::BasicCycleCounter<Modelled> counter{Modelled{&model}};
  EXPECT_EQ(model.writes, (Writes{{0xe000'edfc, 0x0100'0001}, {0xe000'1004, 0}, {0xe000'1000, 0x4000'0001}}))
      << "TRCENA, CYCCNT, CYCCNTENA";
  model.at(0xe000'1004) = 0xffff'fff0;
  counter.start();
  model.at(0xe000'1004) = 0x10;
  EXPECT_EQ(counter.stop(), 0x20U);
}

// MPS2 (AN386, DDI 0479) ----------------------------------------------------------------------------------------------

TEST(Mps2, UartIsConfiguredBeforeItIsOn) {
  test::PlainModel model;
  mps2::BasicUart<Modelled> uart{Modelled{&model}};
  uart.start();
  EXPECT_EQ(model.writes, (Writes{{0x4000'4010, 27}, {0x4000'4008, 0b1011}}))
      << "25 MHz / 921600; RX interrupt, RX, TX";
  EXPECT_EQ(model.interrupts, std::vector<std::uint32_t>{0});
  model.writes.clear();
  model.at(0x4000'4004) = 0;  // STATE: nothing there
  model.at(0x4000'4000) = 'x';
  uart.on_receive();
  EXPECT_EQ(model.writes, (Writes{{0x4000'400c, 0b10}})) << "the receive interrupt alone is cleared";
  std::array<std::uint8_t, 4> bytes{};
  EXPECT_EQ(uart.read(bytes), 0U);
  model.at(0x4000'4004) = 0b10;
  uart.on_receive();
  EXPECT_EQ(uart.read(bytes), 1U);
  EXPECT_EQ(bytes[0], 'x');
}

TEST(Mps2, TimerAndClock) {
  test::PlainModel model;
  mps2::BasicTimer<Modelled> timer{Modelled{&model}};
  ASSERT_EQ(timer.start(2), Status::ok);
  EXPECT_EQ(model.writes, (Writes{{0x4000'0000, 0}, {0x4000'0008, 49}, {0x4000'0004, 49}, {0x4000'0000, 0b1001}}));
  EXPECT_EQ(model.interrupts, std::vector<std::uint32_t>{8});
  model.writes.clear();
  timer.on_interrupt();
  EXPECT_EQ(model.writes, (Writes{{0x4000'000c, 1}}));
  EXPECT_EQ(timer.start(171'798'691), Status::ok) << "25 counts a microsecond in 32 bits";
  EXPECT_EQ(model.at(0x4000'0008), 4'294'967'274U);
  EXPECT_EQ(timer.start(171'798'692), Status::failed);

  test::PlainModel fpga;
  mps2::BasicMicrosecondClock<Modelled> clock{Modelled{&fpga}};
  EXPECT_EQ(fpga.writes, (Writes{{0x4002'801c, 24}}));
  fpga.at(0x4002'8018) = 123;
  EXPECT_EQ(clock.now_us(), 123U);
}

TEST(Mps2, Watchdog) {
  test::PlainModel model;
  mps2::BasicWatchdog<Modelled> watchdog{Modelled{&model}};
  watchdog.start(1000);
  EXPECT_EQ(model.writes,
            (Writes{{0x4000'8c00, 0x1acc'e551}, {0x4000'8000, 25'000}, {0x4000'8008, 0b11}, {0x4000'8c00, 0}}));
  model.writes.clear();
  watchdog.feed();
  EXPECT_EQ(model.writes, (Writes{{0x4000'8c00, 0x1acc'e551}, {0x4000'800c, 1}, {0x4000'8c00, 0}}));
}

template <int number>
void mps2_output_changes_its_pin_alone(Address at) {
  test::PlainModel model;
  mps2::OutputPin<number, true, Modelled> pin{Modelled{&model}};
  EXPECT_EQ(model.writes, (Writes{{at, 0}, {0x4001'0010, 1U << number}})) << number;
  EXPECT_EQ(pin.set(true), Status::ok);
  EXPECT_EQ(model.writes.back(), (std::pair<Address, std::uint32_t>{at, 1U << number}));
  EXPECT_EQ(pin.set(false), Status::ok);
  EXPECT_EQ(model.at(at), 0U);
}
TEST(Mps2, Pins) {
  mps2_output_changes_its_pin_alone<0>(0x4001'0000 + 0x400 + 4 * 0x01);
  mps2_output_changes_its_pin_alone<7>(0x4001'0000 + 0x400 + 4 * 0x80);
  mps2_output_changes_its_pin_alone<8>(0x4001'0000 + 0x800 + 4 * 0x01);
  mps2_output_changes_its_pin_alone<15>(0x4001'0000 + 0x800 + 4 * 0x80);
  test::PlainModel model;
  mps2::InputPin<3, true, Modelled> pin{Modelled{&model}};
  EXPECT_EQ(model.writes, (Writes{{0x4001'0014, 1U << 3}})) << "OUTENCLR";
  bool on = true;
  for (const auto& [level, expected] : {std::pair{0xffff'fff7U, false}, std::pair{1U << 3, true}}) {
    model.at(0x4001'0000) = level;
    EXPECT_EQ(pin.read(on), Status::ok);
    EXPECT_EQ(on, expected);
  }
}

// STM32 ---------------------------------------------------------------------------------------------------------------

TEST(Stm32g4, TimersAreSetUpBeforeTheyRun) {
  test::PlainModel model;
  stm32g4::BasicTimer<Modelled> timer{Modelled{&model}};
  ASSERT_EQ(timer.start(0x10000), Status::ok) << "the longest period of 16 bits";
  EXPECT_EQ(model.writes, (Writes{{0x4000'1028, 15},      // PSC: 16 MHz until told otherwise
                                  {0x4000'102c, 0xffff},  // ARR
                                  {0x4000'1014, 1},       // EGR: UG
                                  {0x4000'1010, 0},       // SR: UIF, which UG has set
                                  {0x4000'100c, 1},       // DIER: UIE
                                  {0x4000'1000, 1}}));    // CR1: CEN
  EXPECT_EQ(timer.start(0x10001), Status::failed);
  EXPECT_EQ(timer.start(0), Status::failed);
  EXPECT_EQ(timer.start(1), Status::ok);
  model.writes.clear();
  timer.on_interrupt();
  timer.on_interrupt();
  EXPECT_EQ(model.writes, (Writes{{0x4000'1010, 0}, {0x4000'1010, 0}}));
  EXPECT_EQ(timer.expired(), 2U);
  EXPECT_EQ(timer.expired(), 0U);

  test::PlainModel tim2;
  stm32g4::BasicMicrosecondClock<Modelled> clock({stm32::ClockSource::internal_slow, 16}, Modelled{&tim2});
  EXPECT_EQ(tim2.writes, (Writes{{0x4000'0028, 15}, {0x4000'002c, 0xffff'ffff}, {0x4000'0014, 1}, {0x4000'0000, 1}}));
  tim2.at(0x4000'0024) = 77;
  EXPECT_EQ(clock.now_us(), 77U);
}

template <std::uint32_t number>
void alternate_function_is_the_pins_alone() {
  test::PlainModel model;
  Modelled registers{&model};
  constexpr Address port = 0x4800'0000, afr = port + (number < 8 ? 0x20 : 0x24);
  for (const Address at : {0x00U, 0x08U, 0x0cU, 0x20U, 0x24U}) model.at(port + at) = 0xffff'ffff;
  stm32::use_alternate_function(registers, port, number, 9);
  const auto two_bits = [](std::uint32_t value) { return ~(3U << 2 * number) | value << 2 * number; };
  EXPECT_EQ(model.at(afr), ~(0xfU << number % 8 * 4) | 9U << number % 8 * 4) << number;
  EXPECT_EQ(model.at(port + 0x08), two_bits(2)) << "OSPEEDR: high speed";
  EXPECT_EQ(model.at(port + 0x0c), two_bits(1)) << "PUPDR: up";
  EXPECT_EQ(model.at(port + 0x00), two_bits(2)) << "MODER: alternate";
  EXPECT_EQ(model.writes.back().first, port) << "the mode last, when the function is right";
  EXPECT_EQ(model.writes.size(), 4U);
}
TEST(Stm32, AlternateFunctions) {
  alternate_function_is_the_pins_alone<0>();
  alternate_function_is_the_pins_alone<7>();
  alternate_function_is_the_pins_alone<8>();
  alternate_function_is_the_pins_alone<12>();
  alternate_function_is_the_pins_alone<15>();
}

TEST(Stm32g4, AStoppedClockOfTheCanControllerRunsAgain) {
  test::FdcanModel model;
  constexpr Address control = 0x4000'6418;
  constexpr std::uint32_t stop_request = 1U << 4;
  model.write(control, 1U | stop_request);
  stm32g4::BasicFdcan<Modelled> can{Modelled{&model}};
  ASSERT_EQ(can.start(stm32g4::fdcan_timing(16'000'000, 1'000'000, 2'000'000)), Status::ok);
  EXPECT_EQ(model.read(control) & stop_request, 0U);
}

TEST(Stm32g4, BitTimingOfTheCanControllerStandsInItsFields) {
  test::FdcanModel model;
  stm32g4::BasicFdcan<Modelled> can{Modelled{&model}};
  ASSERT_EQ(can.start({{.prescaler = 300, .segment1 = 200, .segment2 = 100, .jump_width = 90},
                       {.prescaler = 21, .segment1 = 20, .segment2 = 11, .jump_width = 7}}),
            Status::ok);
  EXPECT_EQ(model.read(0x4000'641c), 89U << 25 | 299U << 16 | 199U << 8 | 99U) << "NBTP";
  EXPECT_EQ(model.read(0x4000'640c), 20U << 16 | 19U << 8 | 10U << 4 | 6U) << "DBTP: a prescaler above 2 bears no TDC";
}

TEST(Stm32g4, ClockRegistersEndAsTheManualHasThem) {
  for (const bool crystal : {true, false}) {
    test::RccModel<test::G4> model;
    model.crystal_starts = crystal;
    // A boot loader has left the PLL on, with the largest of every field, and AHB divided by 512.
    model.write(0x4002'100c, 0b11U | 0xfU << 4 | 0x7fU << 8 | 0b11U << 21 | 0b11U << 25);
    model.write(0x4002'1000, model.read(0x4002'1000) | 1U << 24);
    model.write(0x4002'1008, 0b1111U << 4 | 0b01U);
    model.write(0x4002'2000, 0x0004'010b);  // and of the flash other wait states, prefetch, no caches
    model.violations.clear();
    ASSERT_EQ(stm32g4::start_clock(Modelled{&model}).mhz, 168U);
    const std::uint32_t source_and_m = crystal ? 0b11U | 5U << 4 : 0b10U | 3U << 4;
    EXPECT_EQ(model.read(0x4002'100c), source_and_m | 84U << 8 | 1U << 20 | 1U << 21 | 1U << 24)
        << "PLLCFGR: N = 84, Q = 4, R = 2, both on";
    EXPECT_EQ(model.read(0x4002'1008), 0b1111U) << "CFGR: PLL, nothing divided";
    EXPECT_EQ(model.read(0x4002'2000), 0x0004'0604U) << "ACR: 4 wait states, caches, no prefetch";
    EXPECT_EQ(model.read(0x4000'7080), 0U) << "CR5: range 1 with boost";
    EXPECT_EQ(model.read(0x4002'1000) >> 16 & 1U, crystal ? 1U : 0U) << "HSE stays on where it works";
    EXPECT_EQ(model.violations, std::vector<std::string>{});
  }
  test::RccModel<test::G4> model;
  model.pll_locks = false;
  EXPECT_EQ(stm32g4::start_clock(Modelled{&model}).mhz, 16U);
  EXPECT_EQ(model.read(0x4002'1000) & (1U << 16 | 1U << 24), 0U) << "neither is left on";
}

TEST(Stm32f4, ClockRegistersEndAsTheManualHasThem) {
  for (const bool crystal : {true, false}) {
    test::RccModel<test::F4> model;
    model.crystal_starts = crystal;
    ASSERT_EQ(stm32f4::start_clock(Modelled{&model}).mhz, 168U);
    const std::uint32_t m_n_source = crystal ? 25U | 336U << 6 | 1U << 22 : 8U | 168U << 6;
    EXPECT_EQ(model.read(0x4002'3804), m_n_source | 7U << 24 | 1U << 29)
        << "PLLCFGR: P = 2, Q = 7; bit 29 as after reset";
    EXPECT_EQ(model.read(0x4002'3c00), 5U | 0b111U << 8) << "ACR: wait states, prefetch, both caches";
    EXPECT_EQ(model.read(0x4002'3808), 0b1010U | 0b101U << 10 | 0b100U << 13) << "CFGR: PLL, APB1 / 4, APB2 / 2";
    EXPECT_EQ(model.read(0x4002'3800) >> 16 & 1U, crystal ? 1U : 0U) << "HSE stays on where it works";
  }
  test::RccModel<test::F4> model;
  model.pll_locks = false;
  EXPECT_EQ(stm32f4::start_clock(Modelled{&model}).mhz, 16U);
  EXPECT_EQ(model.read(0x4002'3800) & (1U << 16 | 1U << 24), 0U) << "neither is left on";
}

/// A peripheral in which one bit field does not take what is written.
template <class Part>
struct Stubborn {
  test::RccModel<Part>* model;
  Address address;
  std::uint32_t sticks;
  std::uint32_t read(Address at) const { return model->read(at) & (at == address ? ~sticks : ~0U); }
  void write(Address at, std::uint32_t value) const { model->write(at, value); }
};
TEST(Stm32f4, ItDoesNotSwitchWithoutWaitStatesNorStayHalfWay) {
  test::RccModel<test::F4> flash;
  EXPECT_EQ(stm32f4::start_clock(Stubborn<test::F4>{&flash, 0x4002'3c00, 0b111}).mhz, 16U);
  EXPECT_FALSE(flash.runs_from_pll());
  test::RccModel<test::F4> system;
  EXPECT_EQ(stm32f4::start_clock(Stubborn<test::F4>{&system, 0x4002'3808, 0b1100}).source,
            stm32::ClockSource::internal_slow);
  EXPECT_FALSE(system.runs_from_pll());
  EXPECT_EQ(system.read(0x4002'3808) & (0b111U << 10 | 0b111U << 13), 0U) << "the buses undivided again";
}
TEST(Stm32g4, ItDoesNotSwitchWithoutWaitStatesNorStayHalfWay) {
  test::RccModel<test::G4> flash;
  EXPECT_EQ(stm32g4::start_clock(Stubborn<test::G4>{&flash, 0x4002'2000, 0xf}).mhz, 16U);
  EXPECT_FALSE(flash.runs_from_pll());
  test::RccModel<test::G4> system;
  EXPECT_EQ(stm32g4::start_clock(Stubborn<test::G4>{&system, 0x4002'1008, 0b1100}).source,
            stm32::ClockSource::internal_slow);
  EXPECT_FALSE(system.runs_from_pll());
  EXPECT_EQ(system.read(0x4002'1008) & 0xf3U, 0b01U) << "undivided again, HSI";
  test::RccModel<test::G4> half;
  EXPECT_EQ(stm32g4::start_clock(Stubborn<test::G4>{&half, 0x4002'1008, 0b1000}).source,
            stm32::ClockSource::internal_slow)
      << "SWS says HSI";
}
TEST(Stm32g4, APllThatDoesNotStopIsLeftAlone) {
  struct Running {
    test::RccModel<test::G4>* model;
    std::uint32_t read(Address at) const { return model->read(at) | (at == 0x4002'1000 ? 1U << 25 : 0); }
    void write(Address at, std::uint32_t value) const { model->write(at, value); }
  };
  test::RccModel<test::G4> model;
  const std::uint32_t before = model.read(0x4002'100c);
  EXPECT_EQ(stm32g4::start_clock(Running{&model}).source, stm32::ClockSource::internal_slow);
  EXPECT_EQ(model.read(0x4002'100c), before);
}

TEST(Stm32f4, ClocksOfThePeripheralsAndTheCauseOfTheReset) {
  test::PlainModel model;
  model.at(0x4002'3830) = 0x0010'0000;  // AHB1ENR after reset
  stm32f4::enable_peripherals(Modelled{&model});
  EXPECT_EQ(model.writes, (Writes{{0x4002'3830, 0x0010'0003}, {0x4002'3844, 1U << 4}})) << "GPIOA, GPIOB; USART1";
  model.at(0x4002'3874) = 1U << 29 | 1U << 26;
  EXPECT_TRUE(stm32f4::reset_by_watchdog(Modelled{&model}));
  EXPECT_EQ(model.at(0x4002'3874), 1U << 29 | 1U << 26 | 1U << 24) << "RMVF";
  model.at(0x4002'3874) = 1U << 26 | 1U << 28 | 1U << 30;
  EXPECT_FALSE(stm32f4::reset_by_watchdog(Modelled{&model})) << "pin, software, window watchdog";
}

TEST(Stm32f4, SysTickAndUsart) {
  test::PlainModel systick;
  stm32f4::BasicMicrosecondClock<Modelled> slow({stm32::ClockSource::internal_slow, 16}, Modelled{&systick});
  EXPECT_EQ(systick.writes, (Writes{{0xe000'e014, 0x00ff'ffff}, {0xe000'e018, 0}, {0xe000'e010, 0b101}}));
  systick.at(0xe000'e018) = 0x0100'0000 - 16 * 1000;
  EXPECT_EQ(slow.now_us(), 1000U);

  test::PlainModel model;
  stm32f4::BasicUsart<Modelled> usart{Modelled{&model}};
  usart.start({stm32::ClockSource::crystal, 168});
  EXPECT_EQ(model.writes, (Writes{{0x4001'1008, 91}, {0x4001'100c, 1U << 13 | 1U << 5 | 1U << 3 | 1U << 2}}))
      << "84 MHz / 921600 = 91.1; UE, RXNEIE, TE, RE";
  EXPECT_EQ(model.interrupts, std::vector<std::uint32_t>{37});
  std::array<std::uint8_t, 4> bytes{};
  for (const auto& [status, there] :
       {std::pair{1U << 7 | 1U << 6 | 1U << 4, 0U}, std::pair{1U << 5, 1U}, std::pair{1U << 3, 1U}}) {
    model.at(0x4001'1000) = status;
    usart.on_receive();
    EXPECT_EQ(usart.read(bytes), there) << status;
  }
}

// Zynq UltraScale+ (UG1087) -------------------------------------------------------------------------------------------

TEST(Zynq, Watchdog) {
  for (const auto& [timeout_ms, counts] : {std::pair{1U, 0U}, std::pair{50U, 19U}, std::pair{10'737U, 4095U}}) {
    test::PlainModel model;
    zynqmp_r5::BasicWatchdog<Modelled> watchdog{Modelled{&model}};
    EXPECT_EQ(watchdog.start(timeout_ms), Status::ok);
    EXPECT_EQ(model.writes, (Writes{{0xff15'0000, 0xab'c000},
                                    {0xff15'0004, 0x0092'0000 | counts << 2 | 1U},
                                    {0xff15'0000, 0xab'c1c3},
                                    {0xff15'0008, 0x1999}}));
  }
  for (const std::uint32_t missing : {0b01U, 0b10U}) {
    struct Partial {
      std::uint32_t missing;
      std::uint32_t read(Address) const { return 0xab'c1c3 & ~missing; }
      void write(Address, std::uint32_t) const {}
    };
    zynqmp_r5::BasicWatchdog<Partial> watchdog{Partial{missing}};
    EXPECT_EQ(watchdog.start(50), Status::failed) << "WDEN and RSTEN both have to be there";
  }
}

TEST(Zynq, ClockRunsOverItsIntervalAtTheRate) {
  test::PlainModel model;
  zynqmp_r5::BasicMicrosecondClock<Modelled> clock{Modelled{&model}};
  EXPECT_EQ(model.writes,
            (Writes{{0xff11'000c, 0b1}, {0xff11'0000, 0b1011}, {0xff11'0024, 0xffff}, {0xff11'000c, 0b1'0010}}));
  model.at(0xff11'0018) = 0xabcd'0000 + 3126;  // what is above 16 bits differs between chips
  EXPECT_EQ(clock.now_us(), 2000U) << "2000.64: 100 MHz / 64 are 0.64 us a count";
}

template <int number>
void zynq_output_changes_its_pin_alone(Address at, std::uint32_t on, std::uint32_t off) {
  test::PlainModel model;
  model.at(0xff0a'0204) = model.at(0xff0a'0208) = 1U << 25;
  zynqmp_r5::OutputPin<number, true, Modelled> pin{Modelled{&model}};
  const std::uint32_t both = 1U << 25 | 1U << number;
  EXPECT_EQ(model.writes, (Writes{{at, off}, {0xff0a'0204, both}, {0xff0a'0208, both}})) << number;
  EXPECT_EQ(pin.set(true), Status::ok);
  EXPECT_EQ(model.at(at), on);
  EXPECT_EQ(pin.set(false), Status::ok);
  EXPECT_EQ(model.at(at), off);
}
TEST(Zynq, Pins) {
  zynq_output_changes_its_pin_alone<0>(0xff0a'0000, 0xfffe'0001, 0xfffe'0000);
  zynq_output_changes_its_pin_alone<15>(0xff0a'0000, 0x7fff'8000, 0x7fff'0000);
  zynq_output_changes_its_pin_alone<16>(0xff0a'0004, 0xfffe'0001, 0xfffe'0000);
  test::PlainModel model;
  model.at(0xff0a'0204) = 0xffff'ffff;
  zynqmp_r5::InputPin<13, false, Modelled> pin{Modelled{&model}};
  EXPECT_EQ(model.writes, (Writes{{0xff0a'0204, ~(1U << 13)}}));
  bool on = false;
  for (const auto& [level, expected] : {std::pair{~(1U << 13), true}, std::pair{1U << 13, false}}) {
    model.at(0xff0a'0060) = level;
    EXPECT_EQ(pin.read(on), Status::ok);
    EXPECT_EQ(on, expected);
  }
}

constexpr BitTiming half_megabit =
    bit_timing(zynqmp_r5::can_limits, zynqmp_r5::can_clock_hz, {.bits_per_second = 500'000});

struct Xcan : testing::Test {
  test::XcanModel model;
  test::FakeClock clock;
  zynqmp_r5::BasicXcan<zynqmp_r5::FrameFormat::controller, test::FakeClock, Modelled> can{clock, Modelled{&model}};
};

TEST_F(Xcan, BusOffLastsAsLongAtSlowerRates) {
  for (const auto& [kilo, us] : {std::pair{500U, 2816U}, std::pair{300U, 4694U}}) {  // 1408 bits, rounded up
    ASSERT_EQ(can.start(half_megabit, kilo), Status::ok);
    model.set_counters(256, 0);
    EXPECT_EQ(can.restart(), Status::busy);
    ClassicFrame frame;
    EXPECT_EQ(can.receive(frame), Status::failed);
    clock.us += us - 1;
    EXPECT_EQ(can.restart(), Status::busy);
    clock.us += 1;
    EXPECT_EQ(can.restart(), Status::ok);
    EXPECT_EQ(can.receive(frame), Status::busy);
  }
}

TEST_F(Xcan, BitTimingStandsInItsFields) {
  ASSERT_EQ(can.start({.prescaler = 7, .segment1 = 13, .segment2 = 6, .jump_width = 3}, 500), Status::ok);
  EXPECT_EQ(model.value(0x08), 6U);
  EXPECT_EQ(model.value(0x0c), 2U << 7 | 5U << 4 | 12U);
  EXPECT_EQ(model.value(0x04), 0U) << "neither loop-back nor sleep nor snoop";
  EXPECT_EQ(model.value(0x60), 0U) << "no acceptance filter";
}

TEST_F(Xcan, LengthsCountersAndRemoteFrames) {
  ASSERT_EQ(can.start(half_megabit, 500), Status::ok);
  ClassicFrame frame{.id = 1, .size = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}};
  ASSERT_EQ(can.send(frame), Status::ok);
  EXPECT_EQ(model.sent.back(), (test::XcanModel::Words{1U << 21, 8U << 28, 0x01020304, 0x05060708}));
  frame.size = 9;
  EXPECT_EQ(can.send(frame), Status::failed);
  model.arrives({1U << 21, 15U << 28, 0x01020304, 0x05060708});
  ASSERT_EQ(can.receive(frame), Status::ok);
  EXPECT_EQ(frame.size, 8) << "a DLC above 8 means 8";
  EXPECT_EQ(frame.data[7], 8);
  model.arrives({1U << 21 | 1U << 20, 8U << 28, 0x01020304, 0x05060708});
  ASSERT_EQ(can.receive(frame), Status::ok);
  EXPECT_TRUE(frame.remote);
  EXPECT_EQ(frame.data, (std::array<std::uint8_t, 8>{})) << "remote frames carry none";
  model.set_counters(3, 130);
  EXPECT_EQ(can.errors().state, CanState::passive);
  EXPECT_EQ(can.errors().transmit, 3);
  EXPECT_EQ(can.errors().receive, 130);
}

}  // namespace
}  // namespace fxdyn::hal
