// expect: static assertion failed
#include "firmware/tick_budget.hpp"

// What the flash costs is not forgotten by saying nothing about it.
constexpr fxdyn::TickBudget budget{.clock_hz = 170'000'000, .tick_us = 2000};
constexpr fxdyn::Instructions per_tick{60'000};
#ifdef FXDYN_OK
static_assert(budget.allows(per_tick, fxdyn::cycles_per_instruction::stm32g4_caches));
#else
static_assert(budget.allows(per_tick));
#endif
