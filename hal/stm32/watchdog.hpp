#pragma once

#include <cstdint>

#include "hal/clock.hpp"
#include "hal/registers.hpp"
#include "hal/status.hpp"

namespace fxdyn::hal::stm32 {

/// What the watchdog's oscillator (LSI) may run at, over temperature and supply: the family's data sheets.
struct LsiRange {
  std::uint32_t lowest_hz, highest_hz;
};

/// The independent watchdog (RM0440, RM0090, "Independent watchdog (IWDG)"): it runs on its own oscillator, so that it
/// also bites where the clock has failed. Once started it can't be stopped.
template <LsiRange lsi, Registers R = MemoryMapped>
class BasicWatchdog {
 public:
  /// What start() takes.
  static constexpr std::uint32_t most_ms = 0xfff / ((lsi.highest_hz + 3999) / 4000);

  explicit constexpr BasicWatchdog(R registers = {}) : registers_(registers) {}

  /// Resets no sooner than `timeout_ms` after it was fed, however fast the LSI; 1 to most_ms.
  Status start(std::uint32_t timeout_ms) {
    if (timeout_ms == 0 || timeout_ms > most_ms) return Status::failed;
    registers_.write(key, 0xcccc);   // starts it, and the LSI with it
    registers_.write(key, 0x5555);   // opens PR and RLR
    registers_.write(prescaler, 0);  // divides by 4
    registers_.write(reload, counts(timeout_ms));
    // Both values cross into the LSI's clock domain: some of its periods, far fewer than these tries.
    const bool taken = wait_for(registers_, status, 0b11, 100'000, true);
    feed();
    return taken ? Status::ok : Status::failed;
  }
  /// The longest it may take where start() was told `timeout_ms`: with the slowest LSI.
  static consteval std::uint32_t longest_ms(std::uint32_t timeout_ms) {
    return ((counts(timeout_ms) + 1) * 4000 + lsi.lowest_hz - 1) / lsi.lowest_hz;
  }
  void feed() { registers_.write(key, 0xaaaa); }

 private:
  /// Of the fastest LSI / 4, rounded up. The counter takes one more than this to run out; since its prescaler runs on
  /// where it is fed, the first count may be cut short by that one.
  static constexpr std::uint32_t counts(std::uint32_t ms) { return ms * ((lsi.highest_hz + 3999) / 4000); }

  static constexpr Address base = 0x4000'3000;
  static constexpr Address key = base + 0x00, prescaler = base + 0x04, reload = base + 0x08, status = base + 0x0c;
  [[no_unique_address]] R registers_;
};
}  // namespace fxdyn::hal::stm32
