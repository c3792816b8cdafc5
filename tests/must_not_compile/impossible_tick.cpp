// expect: static assertion failed
#include "firmware/tick_budget.hpp"

#ifdef FXDYN_OK
constexpr std::uint64_t instructions_per_tick = 30'000;
#else
constexpr std::uint64_t instructions_per_tick = 30'000'000;
#endif
static_assert(fxdyn::TickBudget{.clock_hz = 170'000'000, .tick_us = 2000}.allows(instructions_per_tick));
