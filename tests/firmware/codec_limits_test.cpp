// The numbers of setpoint_codec.hpp, slow_division.hpp and serial_protocol.hpp at the ends of their ranges.

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <limits>

#include "firmware/protocol/serial_protocol.hpp"
#include "firmware/protocol/setpoint_codec.hpp"
#include "firmware/slow_division.hpp"

namespace fxdyn {
namespace {

constexpr std::int32_t least = std::numeric_limits<std::int32_t>::min(),
                       most = std::numeric_limits<std::int32_t>::max();

TEST(CodecLimits, AShareIsOfTheLargerEndAndOfOneAtLeast) {
  EXPECT_EQ(whole_share(0, 0), 1);
  EXPECT_EQ(whole_share(-1, 0), 1);
  EXPECT_EQ(whole_share(-2, 1), 2);
  EXPECT_EQ(whole_share(-1, 3), 3);
  EXPECT_EQ(whole_share(5, 3), 3);
  EXPECT_EQ(whole_share(-most, 0), most);
  EXPECT_EQ(whole_share(least, 0), most) << "its negative has no place";
  EXPECT_EQ(whole_share(least + 2, 0), most - 1);
}

TEST(CodecLimits, SharesRoundHalfUpAndSaturate) {
  EXPECT_EQ(from_share(1, 1 << 14), 1) << "a half";
  EXPECT_EQ(from_share(1, (1 << 14) - 1), 0);
  EXPECT_EQ(from_share(-1, 1 << 14), 0) << "minus a half";
  EXPECT_EQ(from_share(-32768, most), -most);
  EXPECT_EQ(to_share(1, 65536), 1) << "a half";
  EXPECT_EQ(to_share(-1, 65536), 0) << "minus a half";
  EXPECT_EQ(to_share(-3, 65536), -1) << "minus one and a half";
  EXPECT_EQ(to_share(-2, 65536), -1);
  EXPECT_EQ(to_share(100, 100), 32767);
  EXPECT_EQ(to_share(-100, 100), -32768);
  EXPECT_EQ(to_share(most, 1), 32767);
  EXPECT_EQ(to_share(least, 1), -32768);
}

TEST(CodecLimits, PerMilleAndMilliSaturateAtTheirWidth) {
  constexpr TorqueScale unit = TorqueScale::of(20, 1000);  // 1 N m rated: 1000 per mille of 2^20
  EXPECT_EQ(to_per_mille(1 << 20, unit), 1000);
  EXPECT_EQ(to_per_mille(-(1 << 20), unit), -1000);
  EXPECT_EQ(to_per_mille(most, TorqueScale::of(10, 1000)), 32767);
  EXPECT_EQ(to_per_mille(least, TorqueScale::of(10, 1000)), -32768);
  EXPECT_EQ(to_per_mille(524, unit), 0) << ".4997";
  EXPECT_EQ(to_per_mille(525, unit), 1) << ".5007";
  for (const std::int32_t rated : {0, -5, 1}) {
    EXPECT_EQ(TorqueScale::of(20, rated).factor, TorqueScale::of(20, 1).factor) << "never divided by nothing";
  }
  EXPECT_EQ(to_milli(1 << 20, 20), 1000);
  EXPECT_EQ(to_milli(most, 5), most);
  EXPECT_EQ(to_milli(least, 5), least);
}

// The product with a raw torque of 32 bits has to stay within 64: no shift above 62, however small the factor.
TEST(CodecLimits, AScaleOfPerMilleShiftsBy62AtMost) {
  const TorqueScale fine = TorqueScale::of(30, 0x7FFF'FFFF);
  EXPECT_EQ(fine.shift, 62);
  EXPECT_EQ(fine.factor, 2'000'000);  // 10^6 2^32 / 2^31
  EXPECT_EQ(TorqueScale::of(20, 0x7FFF'FFFF).shift, 62);
  EXPECT_EQ(TorqueScale::of(19, 0x7FFF'FFFF).shift, 19 + 42);
}

TEST(CodecLimits, TheTickIsTheLowestBitOfTheAcceleration) {
  WireSetpoint setpoint{.q = 1, .dq = 2, .ddq = -3};
  setpoint.of_tick(false);
  EXPECT_EQ(setpoint.ddq, -4);
  EXPECT_FALSE(setpoint.is_odd());
  setpoint.of_tick(true);
  EXPECT_EQ(setpoint.ddq, -3);
  EXPECT_TRUE(setpoint.is_odd());
  EXPECT_EQ(setpoint.dq, 2);
}

TEST(CodecLimits, TheStatusBitsStandAsOnTheWire) {
  using namespace torque_status;  // NOLINT: these five
  EXPECT_EQ((std::array<int, 5>{fresh, ramping, step_limited, at_limit, enabled}),
            (std::array{0x01, 0x02, 0x04, 0x08, 0x10}));
}

TEST(CodecLimits, QuotientsOfAllWidths) {
  for (const std::uint64_t a : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{7}, std::uint64_t{0xFFFF'FFFF},
                                std::uint64_t{0x8000'0000'0000'0000}, ~std::uint64_t{0}}) {
    for (const std::uint32_t b : {1U, 2U, 3U, 7U, 0x8000'0000U, 0xFFFF'FFFFU}) {
      EXPECT_EQ(slow_quotient(a, b), a / b) << a << " / " << b;
    }
  }
}

TEST(CodecLimits, AReaderStartsInStepAndTellsWhatItHolds) {
  serial::FrameReader<2> reader;
  EXPECT_EQ(reader.space(), serial::frame_bytes(2));
  EXPECT_EQ(reader.corrupt_frames(), 0U);
  reader.push(std::array<std::uint8_t, 3>{serial::sync[0], serial::sync[1], 0});
  EXPECT_EQ(reader.space(), serial::frame_bytes(2) - 3);
  serial::Frame<2> frame;
  EXPECT_FALSE(reader.next(frame));
  EXPECT_EQ(reader.corrupt_frames(), 0U) << "the beginning of a frame is no damage";
  reader.push(std::array<std::uint8_t, 1>{3});
  EXPECT_FALSE(reader.next(frame));
  EXPECT_EQ(reader.corrupt_frames(), 1U) << "longer than any that it takes";
}

}  // namespace
}  // namespace fxdyn
