#pragma once

#include <cstdint>

namespace fxdyn {

/// Processor cycles, measured on the drive: object 0x2002 of the drive node, or DWT_CYCCNT around your own call.
struct Cycles {
  std::uint64_t count = 0;
};

/// Instructions, counted by `fxdyn replay` or in firmware/budget.csv. They say nothing about cycles without a
/// CyclesPerInstruction.
struct Instructions {
  std::uint64_t count = 0;
};

/// An upper bound for a core and the memory that its code and tables are in.
struct CyclesPerInstruction {
  std::uint64_t hundredths = 0;
};

/// The model's tick on a Cortex-M4 in an STM32G4, code and tables in its flash: the slowest figures of
/// firmware/cycles.csv (docs/findings/2026-11-23-cycles.md), rounded up. A timing model's, not a board's.
namespace cycles_per_instruction {
inline constexpr CyclesPerInstruction stm32g4_no_wait_states{140};
inline constexpr CyclesPerInstruction stm32g4_caches{
    270};  ///< 170 MHz: 4 wait states; caches, whatever the prefetch does
inline constexpr CyclesPerInstruction stm32g4_no_caches{320};  ///< 170 MHz: 4 wait states; neither caches nor prefetch
inline constexpr CyclesPerInstruction worst = stm32g4_no_caches;
}  // namespace cycles_per_instruction

/// What a drive may spend on the feedforward. A tick that does not fit fails to compile instead of overrunning:
///   constexpr fxdyn::TickBudget budget{.clock_hz = 168'000'000, .tick_us = 2000};
///   static_assert(budget.allows(fxdyn::Cycles{25'000}));        // measured
///   static_assert(budget.allows(fxdyn::Instructions{12'000}));  // counted, at the worst that is known
struct TickBudget {
  std::uint64_t clock_hz = 0;
  std::uint64_t tick_us = 0;
  std::uint64_t largest_load_percent = 50;  ///< the rest belongs to the bus, the current loop, the margin

  consteval std::uint64_t cycles() const { return clock_hz * tick_us / 1'000'000; }
  consteval std::uint64_t load_percent(Cycles needed) const {
    return (100 * needed.count + cycles() - 1) / cycles();  // cycles() == 0: no constant
  }
  consteval bool allows(Cycles needed) const { return load_percent(needed) <= largest_load_percent; }
  consteval bool allows(Instructions counted, CyclesPerInstruction each = cycles_per_instruction::worst) const {
    return allows(Cycles{(counted.count * each.hundredths + 99) / 100});
  }
};

}  // namespace fxdyn
