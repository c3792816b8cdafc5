// Vector table of the BBC micro:bit (Nordic nRF51822, Cortex-M0). No interrupt is in use.

#include "hal/cortex_m/startup.hpp"

namespace {
[[gnu::section(".vectors"), gnu::used]] constexpr auto vectors = fxdyn::hal::cortex_m::make_vectors<32>();
}
