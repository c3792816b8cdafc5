#pragma once

#include <cstdint>

#include "hal/clock.hpp"
#include "hal/registers.hpp"
#include "hal/status.hpp"

namespace fxdyn::hal::stm32 {

/// The independent watchdog (RM0440, RM0090, "Independent watchdog (IWDG)"): it runs on its own oscillator (LSI, about
/// 32 kHz), so that it also bites where the clock has failed. Once started it can't be stopped.
template <Registers R = MemoryMapped>
class BasicWatchdog {
 public:
  explicit constexpr BasicWatchdog(R registers = {}) : registers_(registers) {}

  /// timeout_ms: 1 to 511, by the nominal LSI; the real one is up to 10 % off.
  Status start(std::uint32_t timeout_ms) {
    constexpr std::uint32_t counts_per_ms = 8;  // 32 kHz / 4
    if (timeout_ms == 0 || timeout_ms * counts_per_ms > 0x1000) return Status::failed;
    registers_.write(key, 0xcccc);   // starts it, and the LSI with it
    registers_.write(key, 0x5555);   // opens PR and RLR
    registers_.write(prescaler, 0);  // divides by 4
    registers_.write(reload, timeout_ms * counts_per_ms - 1);
    // Both values cross into the LSI's clock domain: some of its periods, far fewer than these tries.
    const bool taken = wait_for(registers_, status, 0b11, 100'000, true);
    feed();
    return taken ? Status::ok : Status::failed;
  }
  void feed() { registers_.write(key, 0xaaaa); }

 private:
  static constexpr Address base = 0x4000'3000;
  static constexpr Address key = base + 0x00, prescaler = base + 0x04, reload = base + 0x08, status = base + 0x0c;
  [[no_unique_address]] R registers_;
};
using Watchdog = BasicWatchdog<>;
static_assert(hal::Watchdog<Watchdog>);

}  // namespace fxdyn::hal::stm32
