#include <gtest/gtest.h>

#include <type_traits>

#include "hal/can_timing.hpp"
#include "hal/polled.hpp"
#include "hal/stm32g4/drive_board.hpp"
#include "hal/zynqmp_r5/xcan.hpp"
#include "tests/hal/models/register_model.hpp"

namespace fxdyn::hal {
namespace {

// At compile time, as the drivers use it.
constexpr auto g4 = stm32g4::BusTimings<1'000'000, 2'000'000>::full_speed;
static_assert(g4.nominal.prescaler == 1 && g4.nominal.quanta() == 84 && g4.nominal.sample_permille() == 869);
static_assert(g4.data.prescaler == 1 && g4.data.quanta() == 42 && g4.data.sample_permille() == 738);
constexpr auto g4_fast = stm32g4::BusTimings<1'000'000, 4'000'000>::full_speed;
static_assert(g4_fast.data.prescaler == 1 && g4_fast.data.quanta() == 21 && g4_fast.data.sample_permille() == 761);
static_assert(g4_fast.data.bit_rate(stm32g4::fdcan_full_speed_hz) == 4'000'000);
constexpr auto slow = stm32g4::BusTimings<1'000'000, 4'000'000>::slow;
static_assert(slow.nominal.prescaler == 1 && slow.nominal.quanta() == 16 && slow.nominal.sample_permille() == 875);
static_assert(slow.data.bit_rate(stm32g4::fdcan_slow_hz) == 4'000'000 && slow.data.quanta() == 4);
constexpr BitTiming xcan = bit_timing(zynqmp_r5::can_limits, 100'000'000, {.bits_per_second = 1'000'000});
static_assert(xcan.bit_rate(100'000'000) == 1'000'000 && xcan.quanta() <= 25);
constexpr BitTiming quarter = bit_timing(zynqmp_r5::can_limits, 100'000'000, {.bits_per_second = 250'000});
static_assert(quarter.bit_rate(100'000'000) == 250'000);
// The sample point is the nearest one, not the nearest in whole per mille: 87.5 % of 170 quanta is 148.75.
constexpr BitTiming of_170 = bit_timing(stm32g4::nominal_limits, 170'000'000, {.bits_per_second = 1'000'000});
static_assert(of_170.prescaler == 1 && of_170.segment1 == 148 && of_170.segment2 == 21);
// A quantum may be as long as a period of the clock, and that as long as it likes.
constexpr BitTiming of_20_hertz = bit_timing(stm32g4::nominal_limits, 20, {.bits_per_second = 1});
static_assert(of_20_hertz.prescaler == 1 && of_20_hertz.quanta() == 20);

// Small fields: what they can't hold is not chosen, and every value that they can is.
constexpr BitTimingLimits tiny{.largest_prescaler = 2,
                               .smallest_segment1 = 1,
                               .largest_segment1 = 7,
                               .smallest_segment2 = 1,
                               .largest_segment2 = 4,
                               .largest_jump_width = 2};
consteval bool is(BitTiming timing, std::uint32_t prescaler, std::uint32_t segment1, std::uint32_t segment2) {
  return timing.prescaler == prescaler && timing.segment1 == segment1 && timing.segment2 == segment2;
}
static_assert(is(bit_timing(tiny, 20, {1, 800}), 2, 7, 2), "20 quanta are too many, its half needs the last prescaler");
static_assert(is(bit_timing(tiny, 12, {1, 666}), 1, 7, 4), "both segments full");
static_assert(is(bit_timing(tiny, 24, {1, 666}), 2, 7, 4));
static_assert(is(bit_timing(tiny, 8, {1, 875}), 1, 6, 1), "the shortest segment 2");
constexpr BitTimingLimits four_at_least{4, 4, 7, 4, 7, 4};
static_assert(is(bit_timing(four_at_least, 9, {1, 555, 25}), 1, 4, 4), "both as short as they may be");
static_assert(is(bit_timing(four_at_least, 12, {1, 875, 300}), 1, 7, 4), "as far as they go");
// Of 12 quanta the nearest is 667, of the 4 that prescaler 3 would make 750: too coarse where 8 are asked for.
constexpr BitTimingLimits coarse{16, 1, 7, 1, 8, 4};
static_assert(is(bit_timing(coarse, 12, {1, 750, 100, 8}), 1, 7, 4));
static_assert(is(bit_timing(coarse, 12, {1, 750, 100, 4}), 3, 2, 1));
static_assert(is(bit_timing(coarse, 12, {1, 750, 100, 5}), 1, 7, 4));
// Equally near: more quanta, then the earlier sample.
static_assert(is(bit_timing(tiny, 16, {1, 500, 25, 4}), 2, 3, 4), "16 quanta are too many");
static_assert(is(bit_timing(coarse, 8, {1, 750, 25, 4}), 1, 5, 2), "as 2 quanta and 1 of four");
static_assert(is(bit_timing(coarse, 8, {1, 687, 100}), 1, 4, 3) && is(bit_timing(coarse, 8, {1, 688, 100}), 1, 5, 2));
static_assert(bit_timing(tiny, 8, {1, 500, 25}).jump_width == 2 && bit_timing(tiny, 8, {1, 875}).jump_width == 1);

// The fields of XCAN's BTR hold one less (UG1085, "Baud rate and bit timing"): 0 is a segment of one quantum.
static_assert(is(bit_timing(zynqmp_r5::can_limits, 8, {1, 250}), 1, 1, 6), "the shortest segment 1");
static_assert(is(bit_timing(zynqmp_r5::can_limits, 8, {1, 875}), 1, 6, 1), "the shortest segment 2");

// What there is no timing for does not compile.
template <BitTimingLimits limits, std::uint32_t clock_hz, BitRate wanted>
concept Possible = requires {
  typename std::integral_constant<std::uint32_t, bit_timing(limits, clock_hz, wanted).prescaler>;
};
constexpr BitTimingLimits wide{2, 1, 16, 1, 8, 4}, late{2, 1, 16, 3, 8, 4};
static_assert(Possible<wide, 10, BitRate{1}> && Possible<late, 20, BitRate{1}>,
              "90.0 % and 85.0 %: 2.5 % from what CiA 301 says");
static_assert(Possible<tiny, 8, BitRate{1, 850}> && !Possible<tiny, 8, BitRate{1, 849}>,
              "87.5 %: 2.5 % off, and 2.6 %");
static_assert(!Possible<tiny, 7, BitRate{1, 857}> && Possible<tiny, 7, BitRate{1, 857, 25, 7}>,
              "seven quanta where eight are usual");
static_assert(!Possible<four_at_least, 8, BitRate{1, 500}> && Possible<four_at_least, 9, BitRate{1, 555}>);
static_assert(!Possible<wide, 10, BitRate{}> && !Possible<wide, 10, BitRate{3}>);

// The clock's tolerance in examples of others.
// F. Hartwich, A. Bassemir, "The Configuration of the CAN Bit Timing", 1999: 1 Mbit/s of 10 MHz with 6 quanta of
// propagation, 0.39 %; 100 kbit/s of 2 MHz with 1 quantum, 1.58 %, the most that CAN bears.
static_assert(clock_tolerance_ppm({1, 7, 2, 1}, 6) == 1'000'000 * 1 / (2 * (130 - 2)));
static_assert(clock_tolerance_ppm({1, 7, 2, 1}, 6) == 3906);
static_assert(clock_tolerance_ppm({2, 5, 4, 4}, 1) == 15873);
// python-can, test_bit_timing.py: 16 MHz / 2, loop delay 250 ns and 10 m: 1.23 %; CAN FD of 80 MHz / 5: 0.48 %.
constexpr BitTiming eighth{2, 10, 5, 4};
static_assert(propagation_quanta(eighth, 16'000'000, 600) == 5);
static_assert(clock_tolerance_ppm(eighth, 5) == 12315);
constexpr BitTiming half_megabit{5, 27, 4, 4}, two_megabit{5, 6, 1, 1};
static_assert(propagation_quanta(half_megabit, 80'000'000, 600) == 10);
static_assert(clock_tolerance_ppm(half_megabit, two_megabit, 10) == 4854);
// Each of the five conditions where it is the narrowest one, and the value of its formula.
static_assert(clock_tolerance_ppm({1, 72, 11, 2}, 40) == 1'000'000 * 2 / (20 * 84));
static_assert(clock_tolerance_ppm({1, 72, 11, 11}, 40) == 1'000'000 * 11 / (2 * (13 * 84 - 11)));
static_assert(clock_tolerance_ppm({1, 62, 21, 21}, 60) == 1'000'000 * 2 / (2 * (13 * 84 - 21)), "phase segment 1 is 2");
static_assert(clock_tolerance_ppm({1, 72, 11, 11}, {1, 30, 11, 2}, 40) == 1'000'000 * 2 / (20 * 42));
static_assert(clock_tolerance_ppm({1, 72, 11, 11}, {8, 30, 11, 11}, 40) ==
              1'000'000 * 11 / (2 * ((6 * 42 - 11) * 8 + 7 * 84)));
static_assert(clock_tolerance_ppm({4, 15, 5, 5}, {1, 30, 11, 5}, 8) ==
              1'000'000 * (5 - 3) / (2 * ((2 * 21 - 5) * 4 + 11 + 4 * 42)));
static_assert(clock_tolerance_ppm({4, 15, 5, 5}, {1, 30, 11, 3}, 8) == 0);
static_assert(clock_tolerance_ppm({1, 7, 2, 1}, 7) == 0 && clock_tolerance_ppm({1, 7, 2, 1}, 8) == 0);
static_assert(clock_tolerance_ppm({1, 7, 2, 1}, {1, 7, 2, 1}, 7) == 0);
static_assert(propagation_quanta({1, 7, 2, 1}, 10'000'000, 600) == 6);
static_assert(propagation_quanta({1, 7, 2, 1}, 10'000'000, 601) == 7);
static_assert(propagation_quanta({1, 7, 2, 1}, 1, 1) == 1, "a part of a quantum is a quantum");
static_assert(propagation_quanta({1, 7, 2, 1}, 1'000'000'000, 2'000'000'000) == 2'000'000'000,
              "and a whole one is one");
// Rounded down from the exact quotient of millionths: whole where it is whole, else the next one below.
static_assert(clock_tolerance_ppm({1, 60, 40, 20}, 10) == 9900 && clock_tolerance_ppm({1, 59, 40, 20}, 10) == 10'000);
static_assert(clock_tolerance_ppm({1, 9, 26, 26}, 0) == 10180 && clock_tolerance_ppm({1, 3, 4, 4}, 0) == 15'000);
static_assert(clock_tolerance_ppm({4, 39, 26, 26}, {1, 59, 37, 28}, 5) == 14432);  // 3: 14432.99
static_assert(clock_tolerance_ppm({1, 71, 30, 30}, {2, 36, 3, 2}, 42) == 2500);    // 3: 2500
static_assert(clock_tolerance_ppm({4, 40, 29, 29}, {4, 52, 33, 14}, 32) == 4110);  // 4: 4110.997
static_assert(clock_tolerance_ppm({2, 35, 40, 40}, {8, 11, 39, 36}, 7) == 8750);   // 4: 8750
static_assert(clock_tolerance_ppm({4, 68, 29, 29}, {2, 11, 12, 10}, 2) == 10180);  // 5: 10180.99
static_assert(clock_tolerance_ppm({4, 17, 12, 12}, {1, 31, 36, 7}, 9) == 4000);    // 5: 4000
static_assert(clock_tolerance_ppm({4, 5, 30, 30}, {4, 49, 16, 4}, 3) == 1582);     // 4, phase segment 1 is 2
static_assert(clock_tolerance_ppm({1, 40'000, 100, 1}, {1, 30, 11, 11}, 8) == 1);

// What the guide says of the STM32G474.
static_assert(stm32g4::crystal_ppm == 100 && stm32g4::internal_ppm == 7'500 + 10'000 + 1'000);
static_assert(stm32g4::full_speed_mhz * 1'000'000 == 2 * stm32g4::fdcan_full_speed_hz);
static_assert(stm32g4::fdcan_full_speed_hz == 84'000'000 && stm32g4::fdcan_slow_hz == 16'000'000);
static_assert(stm32g4::classic_tolerance_ppm(g4) == 5087);
static_assert(stm32g4::fd_tolerance_ppm(g4) == 5087 && stm32g4::fd_tolerance_ppm(g4_fast) == 5087);
static_assert(2 * stm32g4::classic_tolerance_ppm(g4) < stm32g4::internal_ppm, "no promise without the crystal");
constexpr BitTiming early = bit_timing(stm32g4::nominal_limits, stm32g4::fdcan_full_speed_hz,
                                       {.bits_per_second = 1'000'000, .sample_permille = 750});
static_assert(clock_tolerance_ppm(early, propagation_quanta(early, stm32g4::fdcan_full_speed_hz, 480)) == 9803);
static_assert(2 * 9803 >= stm32g4::internal_ppm + stm32g4::crystal_ppm);

TEST(BitTiming, StaysWithinTheFields) {
  for (const auto& timing : {g4.nominal, slow.nominal, early, of_170}) {
    EXPECT_LE(timing.segment1, stm32g4::nominal_limits.largest_segment1);
    EXPECT_LE(timing.segment2, stm32g4::nominal_limits.largest_segment2);
    EXPECT_GE(timing.jump_width, 1U);
    EXPECT_LE(timing.jump_width, timing.segment2);
  }
  EXPECT_LE(xcan.segment1, 16U);
  EXPECT_LE(xcan.segment2, 8U);
  EXPECT_LE(xcan.jump_width, 4U);
}

TEST(BusTimings, WithoutTheCrystalFdIsNotAllowed) {
  using Bus = stm32g4::BusTimings<1'000'000, 4'000'000>;
  using stm32::ClockSource;
  EXPECT_TRUE(Bus::fd_allowed({ClockSource::crystal, 168}));
  EXPECT_FALSE(Bus::fd_allowed({ClockSource::internal, 168}));
  EXPECT_FALSE(Bus::fd_allowed({ClockSource::internal_slow, 16}));
  EXPECT_EQ(&Bus::of({ClockSource::internal, 168}), &Bus::full_speed);
  EXPECT_EQ(&Bus::of({ClockSource::internal_slow, 16}), &Bus::slow);
}

TEST(Microseconds, GoOnThroughWrapsOfTheCounter) {
  Microseconds<16> time(Microseconds<16>::Rate{1'562'500});
  std::uint64_t count = 0;
  for (int i = 0; i < 10'000'000 / 30; ++i) {
    count += 40'000;  // 25.6 ms
    const std::uint32_t us = time.now(static_cast<std::uint32_t>(count & 0xffff));
    const auto exact = static_cast<std::uint32_t>(count * 64 / 100);
    ASSERT_LE(exact - us, 4U) << count;  // 2^-33 us a count
  }
}

TEST(PolledTimer, CountsPeriodsAlsoThoseThatNobodyAskedFor) {
  test::FakeClock clock{0xffff'ff00};
  PolledTimer timer(clock);
  EXPECT_EQ(timer.expired(), 0U);
  EXPECT_EQ(timer.start(0), Status::failed);
  EXPECT_EQ(timer.start(1000), Status::ok);
  EXPECT_EQ(timer.expired(), 0U);
  clock.us += 999;
  EXPECT_EQ(timer.expired(), 0U);
  clock.us += 1;
  EXPECT_EQ(timer.expired(), 1U);
  EXPECT_EQ(timer.expired(), 0U);
  clock.us += 3500;
  EXPECT_EQ(timer.expired(), 3U);
  clock.us += 500;
  EXPECT_EQ(timer.expired(), 1U);
}

}  // namespace
}  // namespace fxdyn::hal
