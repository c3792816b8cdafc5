// expect: no_bit_timing_gives_this_bit_rate_from_this_clock
#include "hal/can_timing.hpp"

// 170 MHz make 1 Mbit/s exactly; 800 kbit/s they do not.
#ifdef FXDYN_OK
constexpr std::uint32_t bits_per_second = 1'000'000;
#else
constexpr std::uint32_t bits_per_second = 800'000;
#endif
constexpr auto timing =
    fxdyn::hal::bit_timing({512, 2, 256, 2, 128, 128}, 170'000'000, {.bits_per_second = bits_per_second});
static_assert(timing.quanta() > 0);
