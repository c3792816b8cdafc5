#pragma once

#include <cstdint>

#include "hal/clock.hpp"
#include "hal/mps2/board.hpp"

/// Set by the linker script: a word of RAM that start-up leaves alone.
extern "C" std::uint32_t fxdyn_kept[];  // NOLINT

namespace fxdyn::hal::mps2 {

/// The watchdog of the Cortex-M System Design Kit (DDI 0479, "APB watchdog"): the first time it runs out it raises an
/// NMI, whose handler calls on_time_out(); the second time it resets. AN385, AN386, AN500.
template <Registers R = MemoryMapped>
class BasicWatchdog {
 public:
  explicit constexpr BasicWatchdog(R registers = {}) : registers_(registers) {}

  void start(std::uint32_t timeout_us) {
    registers_.write(lock, unlock_key);
    registers_.write(load, timeout_us * (clock_hz / 1'000'000));
    registers_.write(control, reset_enable | interrupt_enable);
    registers_.write(lock, 0);
  }
  /// Reloads the counter, as clearing the interrupt does.
  void feed() {
    registers_.write(lock, unlock_key);
    registers_.write(interrupt_clear, 1);
    registers_.write(lock, 0);
  }
  /// Leaves a mark for after the reset, which nothing else on this board tells from another one.
  void on_time_out() { registers_.write(mark_address(), bitten); }
  /// Whether the watchdog made the last reset; asking forgets it. After power-on the word holds anything, so it may be
  /// wrong once in 2^32 times.
  bool made_the_reset() {
    const bool was = registers_.read(mark_address()) == bitten;
    registers_.write(mark_address(), 0);
    return was;
  }

 private:
  static Address mark_address() {
    return static_cast<Address>(reinterpret_cast<std::uintptr_t>(fxdyn_kept));
  }  // NOLINT
  static constexpr std::uint32_t bitten = 0x0b17'7e4d;
  static constexpr Address base = 0x4000'8000;
  static constexpr Address load = base + 0x000, control = base + 0x008, interrupt_clear = base + 0x00c,
                           lock = base + 0xc00;
  static constexpr std::uint32_t interrupt_enable = 1U << 0, reset_enable = 1U << 1;
  static constexpr std::uint32_t unlock_key = 0x1acc'e551;
  [[no_unique_address]] R registers_;
};
using Watchdog = BasicWatchdog<>;
static_assert(hal::Watchdog<Watchdog>);

}  // namespace fxdyn::hal::mps2
