#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware/protocol/canopen.hpp"
#include "model/fixed.hpp"

// What 8 bytes of a setpoint and of a torque frame mean. Node and host both call these functions: what the host
// quantises is what the node computes with, bit for bit.

namespace fxdyn {

/// A setpoint on the wire: q raw in the model's format, dq and ddq as shares of the joint's limit, 32768 the whole.
struct WireSetpoint {
  static constexpr std::size_t bytes = 8;
  std::int32_t q = 0;
  std::int16_t dq = 0, ddq = 0;
  bool operator==(const WireSetpoint&) const = default;

  /// Where object 0x2013 says so, the lowest bit of ddq is the number of the tick, modulo 2: the setpoints of all
  /// joints of one tick have the same. It costs half a step of ddq and stays part of the number.
  constexpr bool is_odd() const { return (ddq & 1) != 0; }
  constexpr void of_tick(bool odd) { ddq = static_cast<std::int16_t>((ddq & ~1) | (odd ? 1 : 0)); }

  static constexpr WireSetpoint load(const std::uint8_t* from) {
    return {static_cast<std::int32_t>(canopen::load<4>(from)), static_cast<std::int16_t>(canopen::load<2>(from + 4)),
            static_cast<std::int16_t>(canopen::load<2>(from + 6))};
  }
  constexpr void store(std::uint8_t* to) const {
    canopen::store<4>(to, static_cast<std::uint32_t>(q));
    canopen::store<2>(to + 4, static_cast<std::uint16_t>(dq));
    canopen::store<2>(to + 6, static_cast<std::uint16_t>(ddq));
  }
};

/// What a share of 32768 is of, raw: the larger end of a range around zero, at least 1 (objects 0x2021, 0x2022).
constexpr std::int32_t whole_share(std::int32_t lower, std::int32_t upper) {
  return std::max({lower < -0x7FFF'FFFF ? 0x7FFF'FFFF : -lower, upper, std::int32_t{1}});
}
/// share * limit / 32768, rounded half up.
constexpr std::int32_t from_share(std::int16_t share, std::int32_t limit) {
  return static_cast<std::int32_t>((std::int64_t{share} * limit + (1 << 14)) >> 15);
}
/// The share nearest to x, rounded half up, saturated. Divides: for the host. limit > 0
constexpr std::int16_t to_share(std::int32_t x, std::int32_t limit) {
  const std::int64_t twice = (std::int64_t{x} << 16) + limit, divisor = std::int64_t{2} * limit;
  const std::int64_t share = twice / divisor - (twice % divisor < 0 ? 1 : 0);
  return static_cast<std::int16_t>(share > 32767 ? 32767 : (share < -32768 ? -32768 : share));
}

/// Bits of a torque frame's last byte.
namespace torque_status {
inline constexpr std::uint8_t fresh = 1U << 0;         ///< computed from setpoints of this tick
inline constexpr std::uint8_t ramping = 1U << 1;       ///< not the model's torque: on its way to zero or back
inline constexpr std::uint8_t step_limited = 1U << 2;  ///< object 0x2011 held it back
inline constexpr std::uint8_t at_limit = 1U << 3;      ///< the joint's torque limit
inline constexpr std::uint8_t enabled = 1U << 4;       ///< the enable input
}  // namespace torque_status

/// A torque on the wire.
struct WireTorque {
  static constexpr std::size_t bytes = 8;
  std::int16_t per_mille = 0;  ///< of the rated torque, as object 0x60B2 of CiA 402-2
  std::int32_t milli = 0;      ///< [mN*m | mN]
  std::uint8_t tick = 0;       ///< low byte of the node's tick count
  std::uint8_t status = 0;     ///< torque_status
  bool operator==(const WireTorque&) const = default;

  static constexpr WireTorque load(const std::uint8_t* from) {
    return {static_cast<std::int16_t>(canopen::load<2>(from)), static_cast<std::int32_t>(canopen::load<4>(from + 2)),
            from[6], from[7]};
  }
  constexpr void store(std::uint8_t* to) const {
    canopen::store<2>(to, static_cast<std::uint16_t>(per_mille));
    canopen::store<4>(to + 2, static_cast<std::uint32_t>(milli));
    to[6] = tick;
    to[7] = status;
  }
};

/// Per mille of a rated torque: raw * factor * 2^-shift, rounded half up, with factor = 10^6 2^(shift - bits) / rated
/// to 31 bits: its error is below 2^-14 per mille over the range of int16.
struct TorqueScale {
  std::int32_t factor = 0;
  int shift = 1;

  /// @param bits fractional bits of the raw torque
  /// @param rated [mN*m | mN], positive
  /// Divides: on a target it is evaluated when compiling (RatedTorques).
  static constexpr TorqueScale of(int bits, std::int32_t rated) {
    const auto divisor = static_cast<std::uint64_t>(rated > 0 ? rated : 1);
    int finer = bits + 42 > 62 ? 62 - bits : 42;
    const auto factor = [&] { return ((std::uint64_t{1'000'000} << finer) + divisor / 2) / divisor; };
    while (factor() > 0x7FFF'FFFFU) --finer;
    return {static_cast<std::int32_t>(factor()), finer + bits};
  }
};

constexpr std::int16_t to_per_mille(std::int32_t raw, TorqueScale scale) {
  const std::int64_t x = raw::shift_right(std::int64_t{raw} * scale.factor, scale.shift);
  return static_cast<std::int16_t>(x > 32767 ? 32767 : (x < -32768 ? -32768 : x));
}

/// Thousandths of a raw number, rounded half up and saturated.
constexpr std::int32_t to_milli(std::int32_t raw, int bits) {
  std::uint32_t outside = 0;
  return raw::narrow(std::int64_t{raw} * 1000, bits, outside);
}
template <int bits>
constexpr std::int32_t to_milli(std::int32_t raw) {
  return to_milli(raw, bits);
}

/// Rated torques of a robot's joints with their reciprocals, a constant of the image.
template <class Model>
struct RatedTorques {
  using Milli = std::array<std::int32_t, Model::joints>;
  using TorqueType = std::remove_reference_t<decltype(typename Model::Torques{}[0])>;
  static constexpr int torque_bits = TorqueType::bits;

  Milli milli{};
  std::array<TorqueScale, Model::joints> scale{};

  constexpr explicit RatedTorques(const Milli& values) : milli(values) {
    for (std::size_t j = 0; j < Model::joints; ++j) scale[j] = TorqueScale::of(torque_bits, values[j]);
  }
};

}  // namespace fxdyn
