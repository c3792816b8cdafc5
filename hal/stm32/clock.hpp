#pragma once

#include <cstdint>

namespace fxdyn::hal::stm32 {

/// What the processor runs from.
enum class ClockSource : std::uint8_t {
  crystal,        ///< full speed from the crystal
  internal,       ///< full speed from the internal oscillator, some per cent off
  internal_slow,  ///< the internal oscillator itself, 16 MHz: the PLL did not lock either
};

struct SystemClock {
  ClockSource source = ClockSource::internal_slow;
  std::uint32_t mhz = 16;
};

/// How often a ready flag is looked at: more than 50 ms, where a crystal takes 2 ms (data sheets, "HSE oscillator
/// characteristics").
inline constexpr std::uint32_t start_up_tries = 100'000;

}  // namespace fxdyn::hal::stm32
