#pragma once

#include "hal/stm32/watchdog.hpp"

namespace fxdyn::hal::stm32g4 {

inline constexpr stm32::LsiRange lsi{29'500, 34'000};  // DS12288, "LSI oscillator characteristics"

template <Registers R = MemoryMapped>
using BasicWatchdog = stm32::BasicWatchdog<lsi, R>;
using Watchdog = BasicWatchdog<>;
static_assert(hal::Watchdog<Watchdog>);

}  // namespace fxdyn::hal::stm32g4
