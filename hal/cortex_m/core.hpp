#pragma once

#include <cstdint>

#include "hal/clock.hpp"
#include "hal/registers.hpp"

// The core's own peripherals that boards share. Armv7-M Architecture Reference Manual (DDI 0403).

namespace fxdyn::hal::cortex_m {

inline void mask_interrupts() { asm volatile("cpsid i" ::: "memory"); }
inline void unmask_interrupts() { asm volatile("cpsie i" ::: "memory"); }

/// Sleeps until an interrupt is pending, masked or not.
inline void wait_for_interrupt() { asm volatile("dsb\n wfi" ::: "memory"); }

/// NVIC_ISERn (B3.4): lets the interrupt through.
template <Registers R>
void enable_interrupt(R& registers, std::uint32_t number) {
  registers.write(0xe000'e100 + 4 * (number / 32), 1U << (number % 32));
}

/// DWT_CYCCNT (C1.8): processor cycles, with 32 bits.
template <Registers R = MemoryMapped>
class BasicCycleCounter {
 public:
  explicit BasicCycleCounter(R registers = {}) : registers_(registers) {
    set_bits(registers_, debug_control, trace_enable);
    registers_.write(cycles, 0);
    set_bits(registers_, control, count_cycles);
  }
  void start() { begin_ = registers_.read(cycles); }
  std::uint32_t stop() { return registers_.read(cycles) - begin_; }
  static constexpr const char* unit() { return "cycles"; }

 private:
  static constexpr Address debug_control = 0xe000'edfc;  // DEMCR
  static constexpr std::uint32_t trace_enable = 1U << 24;
  static constexpr Address control = 0xe000'1000, cycles = 0xe000'1004;  // DWT_CTRL, DWT_CYCCNT
  static constexpr std::uint32_t count_cycles = 1U << 0;

  [[no_unique_address]] R registers_;
  std::uint32_t begin_ = 0;
};
using CycleCounter = BasicCycleCounter<>;
static_assert(hal::CycleCounter<CycleCounter>);

}  // namespace fxdyn::hal::cortex_m
