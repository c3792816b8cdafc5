#include <gtest/gtest.h>

#include "hal/can_timing.hpp"
#include "hal/polled.hpp"
#include "hal/stm32g4/fdcan.hpp"
#include "hal/zynqmp_r5/xcan.hpp"
#include "tests/hal/models/register_model.hpp"

namespace fxdyn::hal {
namespace {

// At compile time, as the drivers use it.
constexpr BitTiming g4 = bit_timing(stm32g4::nominal_limits, 170'000'000, {.bits_per_second = 1'000'000});
static_assert(g4.bit_rate(170'000'000) == 1'000'000 && 170'000'000 % g4.prescaler == 0);
static_assert(g4.sample_permille() == 876 || g4.sample_permille() == 875 || g4.sample_permille() == 874);
constexpr BitTiming slow = bit_timing(stm32g4::nominal_limits, 16'000'000, {.bits_per_second = 1'000'000});
static_assert(slow.prescaler == 1 && slow.quanta() == 16 && slow.sample_permille() == 875);
constexpr BitTiming xcan = bit_timing(zynqmp_r5::can_limits, 100'000'000, {.bits_per_second = 1'000'000});
static_assert(xcan.bit_rate(100'000'000) == 1'000'000 && xcan.quanta() <= 25);
constexpr BitTiming quarter = bit_timing(zynqmp_r5::can_limits, 100'000'000, {.bits_per_second = 250'000});
static_assert(quarter.bit_rate(100'000'000) == 250'000);
constexpr auto fd = stm32g4::fdcan_timing(170'000'000, 1'000'000, 5'000'000);
static_assert(fd.data.prescaler == 1 && fd.data.quanta() == 34);

TEST(BitTiming, StaysWithinTheFields) {
  for (const auto& timing : {g4, slow, fd.nominal}) {
    EXPECT_LE(timing.segment1, stm32g4::nominal_limits.largest_segment1);
    EXPECT_LE(timing.segment2, stm32g4::nominal_limits.largest_segment2);
    EXPECT_GE(timing.jump_width, 1U);
    EXPECT_LE(timing.jump_width, timing.segment2);
  }
  EXPECT_LE(xcan.segment1, 16U);
  EXPECT_LE(xcan.segment2, 8U);
  EXPECT_LE(xcan.jump_width, 4U);
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
