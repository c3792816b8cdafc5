// expect: no matching function for call
#include "firmware/tick_budget.hpp"

// Measured cycles have the flash's wait states in them.
constexpr fxdyn::TickBudget budget{.clock_hz = 170'000'000, .tick_us = 2000};
#ifdef FXDYN_OK
static_assert(budget.allows(fxdyn::Cycles{25'000}));
#else
static_assert(budget.allows(fxdyn::Cycles{25'000}, fxdyn::cycles_per_instruction::worst));
#endif
