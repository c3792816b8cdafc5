#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "hal/serial.hpp"

namespace fxdyn::hal::fake {

/// A serial port in memory: a test fills `incoming` and looks at `outgoing`.
class Serial {
 public:
  std::deque<std::uint8_t> incoming;
  std::vector<std::uint8_t> outgoing;
  std::size_t write_limit = SIZE_MAX;  ///< bytes that one write accepts, as a full transmit buffer does

  std::size_t read(std::span<std::uint8_t> bytes) {
    const std::size_t count = std::min(bytes.size(), incoming.size());
    std::copy_n(incoming.begin(), count, bytes.begin());
    incoming.erase(incoming.begin(), incoming.begin() + static_cast<std::ptrdiff_t>(count));
    return count;
  }
  std::size_t write(std::span<const std::uint8_t> bytes) {
    const std::size_t count = std::min(bytes.size(), write_limit);
    outgoing.insert(outgoing.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count));
    return count;
  }
};
static_assert(SerialPort<Serial>);

}  // namespace fxdyn::hal::fake
