#pragma once

#include "hal/registers.hpp"

// STM32G474: addresses from RM0440, "Memory map and register boundary addresses"; interrupts from "Vector table".

namespace fxdyn::hal::stm32g4 {

inline constexpr Address rcc = 0x4002'1000, flash = 0x4002'2000, pwr = 0x4000'7000;
inline constexpr Address gpio_a = 0x4800'0000, gpio_b = 0x4800'0400;
inline constexpr Address tim2 = 0x4000'0000, tim6 = 0x4000'1000;
inline constexpr Address fdcan1 = 0x4000'6400, fdcan1_message_ram = 0x4000'a400;
inline constexpr std::uint32_t fdcan1_interrupt = 21, tim6_interrupt = 54;  // FDCAN1_IT0, TIM6_DAC

}  // namespace fxdyn::hal::stm32g4
