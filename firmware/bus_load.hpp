#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/protocol/setpoint_codec.hpp"
#include "hal/can.hpp"

// How long frames and ticks occupy a bus at most: with every stuff bit that can occur, the pause between frames
// included.

namespace fxdyn::bus_load {

/// Bits of a data frame with 11-bit identifier and `bytes` data (ISO 11898-1). 34 bits and the data are stuffed, in the
/// worst case one bit after the first five and then after every four (Davis et al., Real-Time Systems 35, 2007, eq. 1).
constexpr std::uint32_t classic_bits(std::uint32_t bytes) { return 8 * bytes + 47 + (34 + 8 * bytes - 1) / 4; }

struct Rates {
  std::uint64_t nominal = 1'000'000;  ///< [bit/s]
  std::uint64_t data = 1'000'000;     ///< [bit/s], of the data phase of FD frames
};

constexpr std::uint64_t classic_ns(std::uint32_t bytes, Rates rates) {
  return classic_bits(bytes) * 1'000'000'000ULL / rates.nominal;
}

/// An FD frame with 11-bit identifier and bit rate switch (ISO 11898-1). Nominal rate: SOF, identifier, RRS, IDE, FDF,
/// res, BRS (17 bits, up to 4 stuff bits), CRC delimiter, ACK slot and delimiter, EOF, intermission (13). Data rate:
/// ESI, DLC, data, then stuff count and CRC-17 or CRC-21 with a fixed stuff bit in front and after every four bits.
constexpr std::uint64_t fd_ns(std::size_t bytes, Rates rates) {
  const std::uint64_t length = hal::fd_length(bytes);
  const std::uint64_t stuffed = 17 + 5 + 8 * length;
  const std::uint64_t stuff_bits = (stuffed - 1) / 4;
  const std::uint64_t check = 4 + (length <= 16 ? 17 : 21);
  const std::uint64_t nominal = 17 + 4 + 13, data = 5 + 8 * length + (stuff_bits - 4) + check + 1 + check / 4;
  return nominal * 1'000'000'000ULL / rates.nominal + data * 1'000'000'000ULL / rates.data;
}

/// A tick of `joints` joints: a setpoint each, SYNC, a torque each.
constexpr std::uint64_t classic_tick_ns(std::uint32_t joints, Rates rates) {
  return classic_ns(0, rates) +
         joints * (classic_ns(WireSetpoint::bytes, rates) + classic_ns(WireTorque::bytes, rates));
}
/// With CAN FD: all setpoints in one frame, SYNC, the torques of each of `nodes` nodes in one frame.
constexpr std::uint64_t fd_tick_ns(std::uint32_t joints, std::uint32_t nodes, Rates rates) {
  return classic_ns(0, rates) + fd_ns(WireSetpoint::bytes * joints, rates) +
         nodes * fd_ns(WireTorque::bytes * ((joints + nodes - 1) / nodes), rates);
}

/// Share of the bus in hundredths of a per cent, rounded up.
constexpr std::uint64_t load(std::uint64_t busy_ns, std::uint64_t tick_us) {
  return (10 * busy_ns + tick_us - 1) / tick_us;
}

}  // namespace fxdyn::bus_load
