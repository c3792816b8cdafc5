#pragma once

#include "hal/registers.hpp"

// STM32F405: addresses from RM0090, "Memory map"; interrupts from "Vector table for STM32F405xx/07xx".

namespace fxdyn::hal::stm32f4 {

inline constexpr Address rcc = 0x4002'3800, flash = 0x4002'3c00;
inline constexpr Address gpio_a = 0x4002'0000, gpio_b = 0x4002'0400;
inline constexpr Address usart1 = 0x4001'1000;
inline constexpr std::uint32_t usart1_interrupt = 37;

}  // namespace fxdyn::hal::stm32f4
