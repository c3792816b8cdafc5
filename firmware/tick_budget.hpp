#pragma once

#include <cstdint>

namespace fxdyn {

/// What a drive may spend on the feedforward. A tick that does not fit fails to compile instead of overrunning:
///   static_assert(fxdyn::TickBudget{.clock_hz = 170'000'000, .tick_us = 2000}.allows(instructions_per_tick));
/// `instructions` is what firmware/budget.csv or your own measurement says of your tables.
struct TickBudget {
  std::uint64_t clock_hz = 0;
  std::uint64_t tick_us = 0;
  /// An upper bound for the core, its flash wait states included; 2 holds for Cortex-M4 code that runs without any.
  std::uint64_t cycles_per_instruction = 2;
  std::uint64_t largest_load_percent = 50;  ///< the rest belongs to the bus, the current loop, the margin

  consteval std::uint64_t cycles() const { return clock_hz * tick_us / 1'000'000; }
  consteval std::uint64_t load_percent(std::uint64_t instructions) const {
    return (100 * instructions * cycles_per_instruction + cycles() - 1) / cycles();  // cycles() == 0: no constant
  }
  consteval bool allows(std::uint64_t instructions) const { return load_percent(instructions) <= largest_load_percent; }
};

}  // namespace fxdyn
