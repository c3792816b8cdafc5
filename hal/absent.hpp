#pragma once

#include <cstdint>

#include "hal/clock.hpp"
#include "hal/gpio.hpp"

// For boards that lack a part.

namespace fxdyn::hal {

/// An input that always says the same.
struct FixedInput {
  bool level = true;
  Status read(bool& on) const {
    on = level;
    return Status::ok;
  }
};
static_assert(InputPin<FixedInput>);

struct AbsentOutput {
  Status set(bool) { return Status::ok; }
};
static_assert(OutputPin<AbsentOutput>);

struct AbsentWatchdog {
  void feed() {}
};
static_assert(Watchdog<AbsentWatchdog>);

struct AbsentCycleCounter {
  void start() {}
  std::uint32_t stop() { return 0; }
  static constexpr const char* unit() { return "nothing"; }
};
static_assert(CycleCounter<AbsentCycleCounter>);

}  // namespace fxdyn::hal
