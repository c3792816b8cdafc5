// expect: tick_without_period.cpp
#include "firmware/tick_budget.hpp"

// A budget of a tick whose period nobody gave allows nothing.
#ifdef FXDYN_OK
constexpr fxdyn::TickBudget budget{.clock_hz = 170'000'000, .tick_us = 2000};
#else
constexpr fxdyn::TickBudget budget{.clock_hz = 170'000'000};
#endif
static_assert(budget.allows(fxdyn::Cycles{10}));
