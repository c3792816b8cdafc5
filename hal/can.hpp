#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/status.hpp"

namespace fxdyn::hal {

/// One frame of a CAN bus as ISO 11898-1 knows it. `capacity`: 8 bytes in classic frames, 64 in CAN FD.
template <std::size_t capacity>
struct CanFrame {
  static constexpr std::size_t most_bytes = capacity;
  std::uint32_t id = 0;   ///< 11 bits; 29 where `extended`
  bool extended = false;  ///< 29-bit identifier
  bool remote = false;    ///< asks for data and carries none (classic only)
  bool fd = false;        ///< CAN FD, with the bit rate switched in the data phase
  std::uint8_t size = 0;  ///< bytes of `data` that count; in FD frames one of the lengths that a DLC can tell
  std::array<std::uint8_t, capacity> data{};
};
using ClassicFrame = CanFrame<8>;
using FdFrame = CanFrame<64>;

/// Bytes of the shortest FD frame that holds `bytes`, up to 64: what a DLC can tell (ISO 11898-1).
constexpr std::size_t fd_length(std::size_t bytes) {
  constexpr std::size_t lengths[]{12, 16, 20, 24, 32, 48};
  if (bytes <= 8) return bytes;
  for (const std::size_t length : lengths) {
    if (bytes <= length) return length;
  }
  return 64;
}

/// Fault confinement, ISO 11898-1: error active below 128 errors, passive from there on, off the bus above 255 transmit
/// errors.
enum class CanState : std::uint8_t { active, passive, bus_off };

struct CanErrors {
  CanState state = CanState::active;
  std::uint8_t transmit = 0, receive = 0;  ///< error counters
  std::uint32_t lost = 0;                  ///< received frames dropped for want of room since start, as far as known
};

/// A CAN controller or socket that is open, bit rate set. No call blocks.
///   send      ok: queued; busy: no room now; failed: not on the bus (bus-off, interface down)
///   receive   ok: `frame` is the oldest one waiting; busy: none; failed: the device is gone
///   restart   leaves bus-off as ISO 11898-1 has it, after 128 times 11 recessive bits; busy while that takes
/// Nothing that a bus can carry is filtered out but frames the device's acceptance filters leave out.
template <class T>
concept CanBus = requires(T& bus, const typename T::Frame& out, typename T::Frame& in) {
  { T::Frame::most_bytes } -> std::convertible_to<std::size_t>;
  { bus.send(out) } -> std::same_as<Status>;
  { bus.receive(in) } -> std::same_as<Status>;
  { bus.errors() } -> std::same_as<CanErrors>;
  { bus.restart() } -> std::same_as<Status>;
};

/// Identifiers of 11 bits, both ends included.
struct IdRange {
  std::uint32_t first = 0, last = 0;
};

/// A bus with acceptance filters. listen(): from now on these identifiers come through; what else does is up to the
/// device, which may be everything. Frames that come while the filters change may be lost.
template <class T>
concept FilteringCanBus = CanBus<T> && requires(T& bus, std::span<const IdRange> ranges) {
  { bus.listen(ranges) } -> std::same_as<void>;
};

/// A bus that sends the lowest identifier first, whatever it was given first, and says whether all is out.
template <class T>
concept SortingCanBus = CanBus<T> && requires(T& bus) {
  { bus.has_sent_all() } -> std::same_as<bool>;
};

}  // namespace fxdyn::hal
