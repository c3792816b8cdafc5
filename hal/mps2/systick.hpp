#pragma once

#include <cstdint>

#include "hal/clock.hpp"
#include "hal/mps2/board.hpp"

namespace fxdyn::hal::mps2 {

/// Counts instructions under `qemu-system-arm -icount shift=8`: there one instruction takes 256 ns of the emulated time
/// that SysTick counts, 5 to 6 of its ticks, so the rounded quotient is exact. Longest stretch: 2.6 million
/// instructions. Registers: Armv7-M Architecture Reference Manual (DDI 0403), B3.3 "The system timer, SysTick".
class SysTick {
 public:
  SysTick() {
    reg(reload) = mask;
    reg(current) = 0;  // any write clears it
    reg(control) = processor_clock | enable;
  }
  void start() {
    mask_interrupts();
    begin_ = reg(current);
  }
  std::uint32_t stop() {
    const std::uint32_t ticks = (begin_ - reg(current)) & mask;  // it counts down
    unmask_interrupts();
    return (ticks * tick_ns + instruction_ns / 2) / instruction_ns;
  }

 private:
  static constexpr std::uintptr_t control = 0xe000'e010;  // SYST_CSR
  static constexpr std::uintptr_t reload = 0xe000'e014;   // SYST_RVR
  static constexpr std::uintptr_t current = 0xe000'e018;  // SYST_CVR
  static constexpr std::uint32_t enable = 1U << 0, processor_clock = 1U << 2;
  static constexpr std::uint32_t mask = 0x00ff'ffff;
  static constexpr std::uint32_t tick_ns = 1'000'000'000 / clock_hz;
  static constexpr std::uint32_t instruction_ns = 256;

  std::uint32_t begin_ = 0;
};
static_assert(CycleCounter<SysTick>);

}  // namespace fxdyn::hal::mps2
