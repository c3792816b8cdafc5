// expect: no matching function for call
#include "firmware/tick_budget.hpp"

constexpr fxdyn::TickBudget budget{.clock_hz = 170'000'000, .tick_us = 2000};
#ifdef FXDYN_OK
static_assert(budget.allows(fxdyn::Cycles{12'000}));
#else
static_assert(budget.allows(12'000));  // cycles or instructions?
#endif
