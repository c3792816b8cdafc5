#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <random>

#include "firmware/bus_load.hpp"
#include "firmware/protocol/setpoint_codec.hpp"
#include "firmware/slow_division.hpp"

namespace fxdyn {
namespace {

// The layout on the wire is the contract with other implementations.
TEST(SetpointCodec, BytesOfASetpoint) {
  std::array<std::uint8_t, 8> bytes{};
  WireSetpoint{0x04030201, 0x0605, -2}.store(bytes.data());
  EXPECT_EQ(bytes, (std::array<std::uint8_t, 8>{0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0xFE, 0xFF}));
  EXPECT_EQ(WireSetpoint::load(bytes.data()), (WireSetpoint{0x04030201, 0x0605, -2}));
}

TEST(SetpointCodec, BytesOfATorque) {
  std::array<std::uint8_t, 8> bytes{};
  WireTorque{-1000, 0x04030201, 0x55, torque_status::fresh | torque_status::enabled}.store(bytes.data());
  EXPECT_EQ(bytes, (std::array<std::uint8_t, 8>{0x18, 0xFC, 0x01, 0x02, 0x03, 0x04, 0x55, 0x11}));
  EXPECT_EQ(WireTorque::load(bytes.data()), (WireTorque{-1000, 0x04030201, 0x55, 0x11}));
}

TEST(SetpointCodec, SharesOfALimit) {
  EXPECT_EQ(from_share(16384, 1001), 501);    // 500.5: half up
  EXPECT_EQ(from_share(-16384, 1001), -500);  // -500.5: half up
  EXPECT_EQ(from_share(-32768, 134217728), -134217728);
  EXPECT_EQ(to_share(134217728, 134217728), 32767);  // the largest there is
  EXPECT_EQ(to_share(-134217728, 134217728), -32768);
  EXPECT_EQ(to_share(INT32_MAX, 1), 32767);
  EXPECT_EQ(to_share(INT32_MIN, 1), -32768);
}

TEST(SetpointCodec, SharesAreTheNearest) {
  std::mt19937 random(1);
  for (int i = 0; i < 100'000; ++i) {
    const auto limit = static_cast<std::int32_t>(1 + random() % 0x7FFF'FFFF);
    const auto x =
        static_cast<std::int32_t>(static_cast<std::int64_t>(random()) % limit) * (random() % 2 != 0 ? 1 : -1);
    const std::int16_t share = to_share(x, limit);
    const double exact = 32768.0 * x / limit;
    if (exact < 32767) {
      EXPECT_LE(std::abs(share - exact), 0.5 + 1e-9) << x << " of " << limit;
    }
    // What goes over the wire once stays what it is, where a share is coarser than a raw unit.
    if (limit > 65536) {
      EXPECT_EQ(to_share(from_share(share, limit), limit), share) << x << " of " << limit;
    }
  }
}

TEST(SetpointCodec, PerMilleOfRated) {
  // 22 fractional bits, 97.6 N*m: one per mille is 0.0976 N*m
  const TorqueScale scale = TorqueScale::of(22, 97'600);
  EXPECT_EQ(to_per_mille(0, scale), 0);
  EXPECT_EQ(to_per_mille(static_cast<std::int32_t>(std::lround(97.6 * (1 << 22))), scale), 1000);
  EXPECT_EQ(to_per_mille(-static_cast<std::int32_t>(std::lround(48.8 * (1 << 22))), scale), -500);
  EXPECT_EQ(to_per_mille(INT32_MAX, TorqueScale::of(22, 1)), 32767);
  EXPECT_EQ(to_per_mille(INT32_MIN, TorqueScale::of(22, 1)), -32768);
}

TEST(SetpointCodec, PerMilleIsTheRoundedQuotient) {
  std::mt19937 random(2);
  for (int i = 0; i < 200'000; ++i) {
    const int bits = static_cast<int>(random() % 31);
    const auto rated = static_cast<std::int32_t>(1 + random() % (1U << random() % 31));
    const auto raw = static_cast<std::int32_t>(random());
    const long double exact = static_cast<long double>(raw) * 1e6L / rated / static_cast<long double>(1ULL << bits);
    const std::int16_t got = to_per_mille(raw, TorqueScale::of(bits, rated));
    const long double within = exact > 32767 ? 32767 : (exact < -32768 ? -32768 : exact);
    EXPECT_LE(std::abs(got - within), 0.5L + 1e-4L) << raw << " " << bits << " " << rated;
  }
}

TEST(SetpointCodec, Milli) {
  EXPECT_EQ(to_milli<22>(1 << 22), 1000);
  EXPECT_EQ(to_milli<22>(-(1 << 22)), -1000);
  EXPECT_EQ(to_milli<1>(1), 500);
  EXPECT_EQ(to_milli<4>(1), 63);    // 62.5
  EXPECT_EQ(to_milli<4>(-1), -62);  // -62.5
  EXPECT_EQ(to_milli<0>(INT32_MAX), INT32_MAX);
  EXPECT_EQ(to_milli<0>(INT32_MIN), INT32_MIN);
}

TEST(SlowDivision, IsDivision) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 20'000; ++i) {
    const std::uint64_t a = random() >> random() % 64;
    const auto b = static_cast<std::uint32_t>((random() >> 32 >> random() % 32) | 1U);
    ASSERT_EQ(slow_quotient(a, b), a / b) << a << " / " << b;
  }
  EXPECT_EQ(slow_quotient(UINT64_MAX, 1), UINT64_MAX);
  EXPECT_EQ(slow_quotient(UINT64_MAX, UINT32_MAX), UINT64_MAX / UINT32_MAX);
}

// 8 data bytes: 111 bits without stuffing (ISO 11898-1, intermission included), 24 stuff bits at most.
TEST(BusLoad, ClassicFrames) {
  static_assert(bus_load::classic_bits(0) == 47 + 8);
  static_assert(bus_load::classic_bits(8) == 111 + 24);
}

// 13 frames: 12 x 135 + 55 = 1675 bits in 2 ms at 1 Mbit/s.
TEST(BusLoad, SixJointsAtOneMegabit) {
  static_assert(bus_load::classic_tick_ns(6, {}) == 1'675'000);
  static_assert(bus_load::load(bus_load::classic_tick_ns(6, {}), 2000) == 8375);
  // A request and an answer by SDO still fit in between.
  static_assert(bus_load::classic_tick_ns(6, {}) + 2 * bus_load::classic_ns(8, {}) < 2'000'000);
  // Half the bit rate is not enough, seven joints neither leave room for an SDO.
  static_assert(bus_load::load(bus_load::classic_tick_ns(6, {.nominal = 500'000}), 2000) > 10'000);
}

// 48 bytes: 34 bits at the nominal rate; 5 + 384 + 97 stuff bits + 25 + 1 + 6 = 518 at the data rate.
TEST(BusLoad, FdFrames) {
  static_assert(bus_load::fd_ns(48, {1'000'000, 1'000'000}) == (34 + 518) * 1000);
  static_assert(bus_load::fd_ns(48, {1'000'000, 4'000'000}) == 34'000 + 518'000 / 4);
  static_assert(bus_load::fd_ns(41, {}) == bus_load::fd_ns(48, {}));  // padded to what a DLC can tell
  // One node with six joints at 1 and 4 Mbit/s: SYNC, 48 bytes, 48 bytes.
  static_assert(bus_load::fd_tick_ns(6, 1, {1'000'000, 4'000'000}) == 55'000 + 2 * (34'000 + 129'500));
  static_assert(bus_load::load(bus_load::fd_tick_ns(6, 1, {1'000'000, 4'000'000}), 2000) == 1910);
  static_assert(bus_load::load(bus_load::fd_tick_ns(6, 1, {1'000'000, 2'000'000}), 2000) == 3205);
}

}  // namespace
}  // namespace fxdyn
