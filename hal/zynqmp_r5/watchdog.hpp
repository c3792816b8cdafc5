#pragma once

#include <cstdint>

#include "hal/clock.hpp"
#include "hal/status.hpp"
#include "hal/zynqmp_r5/board.hpp"

namespace fxdyn::hal::zynqmp_r5 {

/// The system watchdog of the low-power domain (UG1087, module SWDT), clocked with 100 MHz (LPD_LSBUS) / 64. It does
/// not reset by itself: its time-out is the error LPD_SWDT of the platform management unit, whose firmware makes a
/// system reset of it unless it was told otherwise. Nothing else may use it (device tree of a Linux on the other
/// processors: watchdog@ff150000 disabled).
template <Registers R = MemoryMapped>
class BasicWatchdog {
 public:
  explicit constexpr BasicWatchdog(R registers = {}) : registers_(registers) {}

  /// timeout_ms: 1 to 10737, rounded up to a multiple of 2.6 ms.
  Status start(std::uint32_t timeout_ms) {
    constexpr std::uint32_t longest_ms = 10'737;
    if (timeout_ms == 0 || timeout_ms > longest_ms) return Status::failed;
    // The counter restarts at 0xNNNFFF: steps of 4096 counts, 4096 / 1562.5 = 8192 / 3125 ms.
    const std::uint32_t steps = (timeout_ms * 3125 + 8191) / 8192;
    registers_.write(mode, mode_key);  // off, should the boot loader have started it
    registers_.write(control, control_key | (steps - 1) << 2 | divide_by_64);
    registers_.write(mode, mode_key | longest_pulses | reset_enable | enable);
    feed();
    return (registers_.read(mode) & (reset_enable | enable)) == (reset_enable | enable) ? Status::ok : Status::failed;
  }
  void feed() { registers_.write(restart, 0x1999); }

 private:
  static constexpr Address mode = swdt + 0x0, control = swdt + 0x4, restart = swdt + 0x8;
  static constexpr std::uint32_t mode_key = 0xabcU << 12, control_key = 0x248U << 14;
  static constexpr std::uint32_t enable = 1U << 0, reset_enable = 1U << 1;   // WDEN, RSTEN
  static constexpr std::uint32_t longest_pulses = 0b11U << 7 | 0b100U << 4;  // IRQLN, RSTLN as after reset
  static constexpr std::uint32_t divide_by_64 = 0b01;                        // CLKSEL
  [[no_unique_address]] R registers_;
};
using Watchdog = BasicWatchdog<>;
static_assert(hal::Watchdog<Watchdog>);

}  // namespace fxdyn::hal::zynqmp_r5
