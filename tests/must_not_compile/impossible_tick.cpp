// expect: static assertion failed
#include "firmware/tick_budget.hpp"

#ifdef FXDYN_OK
constexpr fxdyn::Instructions per_tick{30'000};
#else
constexpr fxdyn::Instructions per_tick{30'000'000};
#endif
static_assert(fxdyn::TickBudget{.clock_hz = 170'000'000, .tick_us = 2000}.allows(per_tick));
