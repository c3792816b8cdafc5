#pragma once

#include <concepts>
#include <cstdint>

#include "hal/status.hpp"

namespace fxdyn::hal {

/// Measures what a stretch of code costs: processor cycles on hardware, instructions under an emulator. What interrupts
/// take meanwhile counts as well: masking them for so long would lose frames and bytes that only they can fetch.
template <class T>
concept CycleCounter = requires(T& counter) {
  { counter.start() } -> std::same_as<void>;
  { counter.stop() } -> std::same_as<std::uint32_t>;
  { counter.unit() } -> std::same_as<const char*>;  ///< what it counts
};

/// Microseconds since some moment; runs on and wraps after 71 minutes, so that only differences mean something.
template <class T>
concept Clock = requires(T& clock) {
  { clock.now_us() } -> std::same_as<std::uint32_t>;
};

/// Expires every period after start(). expired(): how often since it was last asked; 0: not yet.
template <class T>
concept TickTimer = requires(T& timer, std::uint32_t period_us) {
  { timer.start(period_us) } -> std::same_as<Status>;
  { timer.expired() } -> std::same_as<std::uint32_t>;
};

/// Resets the processor unless fed in time.
template <class T>
concept Watchdog = requires(T& watchdog) {
  { watchdog.feed() } -> std::same_as<void>;
};

}  // namespace fxdyn::hal
