#pragma once

#include <concepts>
#include <cstdint>

namespace fxdyn::hal {

/// Measures what a stretch of code costs: processor cycles on hardware, instructions under an emulator. Interrupts stay
/// out of the count: between start() and stop() they are masked.
template <class T>
concept CycleCounter = requires(T& counter) {
  { counter.start() } -> std::same_as<void>;
  { counter.stop() } -> std::same_as<std::uint32_t>;
};

}  // namespace fxdyn::hal
