#pragma once

#include <string>

#include "host_tools/report/results.hpp"

namespace fxdyn {

/// Cycles that an instruction of the tick takes at most on an STM32G474 at 170 MHz, 4 wait states, neither caches nor
/// prefetch: a timing model's figure (docs/findings/2026-11-23-cycles.md, firmware/tick_budget.hpp), not a board's.
inline constexpr double stm32g4_cycles_per_instruction = 3.2;
inline constexpr double stm32g4_clock_hz = 170e6;  ///< RM0440, the largest

/// What the drive would do, in one sentence: instructions, time, memory, bit-exact or not yet replayed.
std::string drive_line(const Results& results);

}  // namespace fxdyn
