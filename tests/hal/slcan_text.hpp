#pragma once

// Frames and text of SLCAN, for its tests.

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "hal/slcan.hpp"

namespace fxdyn::hal::test {

inline std::string line_of(const ClassicFrame& frame) {
  std::array<std::uint8_t, slcan::longest_line> line{};
  const std::size_t size = slcan::encode(frame, line);
  return {line.begin(), line.begin() + static_cast<std::ptrdiff_t>(size)};
}
inline std::span<const std::uint8_t> bytes(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace fxdyn::hal::test
