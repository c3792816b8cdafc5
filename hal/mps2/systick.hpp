#pragma once

#include <cstdint>

#include "hal/clock.hpp"
#include "hal/cortex_m/core.hpp"
#include "hal/mps2/board.hpp"

namespace fxdyn::hal::mps2 {

/// Counts instructions under `qemu-system-arm -icount shift=8`: there one instruction takes 256 ns of the emulated time
/// that SysTick counts, 5 to 6 of its ticks, so the rounded quotient is exact. Longest stretch: 2.6 million
/// instructions. Registers: Armv7-M Architecture Reference Manual (DDI 0403), B3.3 "The system timer, SysTick".
/// `masks_interrupts`: between start() and stop(), so that the count is the same in every run. For images that only
/// measure: an emulator's line waits meanwhile, a real one loses bytes.
template <bool masks_interrupts>
class BasicSysTick {
 public:
  BasicSysTick() {
    MemoryMapped::write(reload, mask);
    MemoryMapped::write(current, 0);  // any write clears it
    MemoryMapped::write(control, processor_clock | enable);
  }
  void start() {
    if constexpr (masks_interrupts) cortex_m::mask_interrupts();
    begin_ = MemoryMapped::read(current);
  }
  std::uint32_t stop() {
    const std::uint32_t ticks = (begin_ - MemoryMapped::read(current)) & mask;  // it counts down
    if constexpr (masks_interrupts) cortex_m::unmask_interrupts();
    return (ticks * tick_ns + instruction_ns / 2) / instruction_ns;
  }
  static constexpr const char* unit() { return "instructions"; }

 private:
  static constexpr Address control = 0xe000'e010;  // SYST_CSR
  static constexpr Address reload = 0xe000'e014;   // SYST_RVR
  static constexpr Address current = 0xe000'e018;  // SYST_CVR
  static constexpr std::uint32_t enable = 1U << 0, processor_clock = 1U << 2;
  static constexpr std::uint32_t mask = 0x00ff'ffff;
  static constexpr std::uint32_t tick_ns = 1'000'000'000 / clock_hz;
  static constexpr std::uint32_t instruction_ns = 256;

  std::uint32_t begin_ = 0;
};
using SysTick = BasicSysTick<false>;
using ExactSysTick = BasicSysTick<true>;
static_assert(CycleCounter<SysTick> && CycleCounter<ExactSysTick>);

}  // namespace fxdyn::hal::mps2
