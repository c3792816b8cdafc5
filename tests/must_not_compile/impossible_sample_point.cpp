// expect: no_bit_timing_gives_this_bit_rate_from_this_clock
#include "hal/zynqmp_r5/xcan.hpp"

// 24 MHz, 1 Mbit/s: at most 24 quanta, so that no sample point lies behind 958 per mille.
#ifdef FXDYN_OK
constexpr std::uint32_t sample_permille = 750;
#else
constexpr std::uint32_t sample_permille = 990;
#endif
constexpr auto timing = fxdyn::hal::bit_timing(fxdyn::hal::zynqmp_r5::can_limits, 24'000'000,
                                               {.bits_per_second = 1'000'000, .sample_permille = sample_permille});
static_assert(timing.quanta() > 0);
