#pragma once

#include <cstdint>

#include "hal/clock.hpp"
#include "hal/registers.hpp"
#include "hal/stm32/clock.hpp"
#include "hal/stm32g4/board.hpp"

namespace fxdyn::hal::stm32g4 {

/// RM0440, "Reset and clock control (RCC)", "Power control (PWR)", "Embedded flash memory": 170 MHz out of a 24 MHz
/// crystal (Nucleo-G474RE), else out of the internal 16 MHz, else those 16 MHz as they are.
template <Registers R>
stm32::SystemClock start_clock(R registers = {}) {
  using stm32::ClockSource;
  constexpr std::uint32_t hse_on = 1U << 16, hse_ready = 1U << 17, pll_on = 1U << 24, pll_ready = 1U << 25;
  constexpr std::uint32_t switch_mask = 0b11, hsi = 0b01, pll = 0b11;
  constexpr std::uint32_t half_ahb = 0b1000U << 4, ahb_mask = 0xfU << 4;
  constexpr Address control = rcc + 0x00, configuration = rcc + 0x08, pll_configuration = rcc + 0x0c;

  set_bits(registers, rcc + 0x58, 1U << 28);  // APB1ENR1: PWREN

  set_bits(registers, control, hse_on);
  const bool crystal = wait_for(registers, control, hse_ready, stm32::start_up_tries);
  if (!crystal) clear_bits(registers, control, hse_on);

  // VCO 340 MHz = 4 MHz * 85, divided by R = 2. The input of 4 MHz: 24 / 6 or 16 / 4.
  const std::uint32_t source_and_m = crystal ? 0b11U | (6 - 1) << 4 : 0b10U | (4 - 1) << 4;
  clear_bits(registers, control, pll_on);
  if (!wait_for(registers, control, pll_ready, stm32::start_up_tries, true)) return {};
  set_field(registers, pll_configuration, 0b11U | 0xfU << 4 | 0x7fU << 8 | 0b11U << 25,
            source_and_m | 85U << 8 | 1U << 24);  // source, M, N, R = 2; REN
  set_bits(registers, control, pll_on);
  if (!wait_for(registers, control, pll_ready, stm32::start_up_tries)) {
    clear_bits(registers, control, pll_on | hse_on);
    return {};
  }

  // Above 150 MHz: range 1 with boost. Flash: 4 wait states (RM0440, table "Number of wait states"), caches, prefetch.
  clear_bits(registers, pwr + 0x80, 1U << 8);  // CR5: R1MODE = 0
  // Only these fields of ACR: DBG_SWEN beside them, set by reset, keeps the debug port open.
  set_field(registers, flash, 0xfU, 4U | 1U << 8 | 1U << 9 | 1U << 10);
  if (!wait_for(registers, flash, 4, stm32::start_up_tries)) return {};
  // From 16 to 170 MHz by way of 85 for at least 1 us ("system clock switch above 80 MHz").
  set_field(registers, configuration, ahb_mask, half_ahb);
  set_field(registers, configuration, switch_mask, pll);
  if (!wait_for(registers, configuration, pll << 2, stm32::start_up_tries)) {  // SWS
    set_field(registers, configuration, switch_mask | ahb_mask, hsi);
    return {};
  }
  for (int i = 0; i < 40; ++i) (void)registers.read(configuration);  // 1 us at 85 MHz with two cycles a read
  clear_bits(registers, configuration, ahb_mask);
  return {crystal ? ClockSource::crystal : ClockSource::internal, 170};
}

/// Whether the independent watchdog made the last reset; asking forgets it (RCC_CSR: IWDGRSTF, RMVF).
template <Registers R>
bool reset_by_watchdog(R registers = {}) {
  const bool was = (registers.read(rcc + 0x94) & 1U << 29) != 0;
  set_bits(registers, rcc + 0x94, 1U << 23);
  return was;
}

/// Clocks of what the node uses: GPIOA, GPIOB, TIM2, TIM6, FDCAN, whose bit clock is PCLK1 (= the processor's).
template <Registers R>
void enable_peripherals(R registers = {}) {
  set_bits(registers, rcc + 0x4c, 0b11);                          // AHB2ENR: GPIOAEN, GPIOBEN
  set_bits(registers, rcc + 0x58, 1U << 0 | 1U << 4 | 1U << 25);  // APB1ENR1: TIM2EN, TIM6EN, FDCANEN
  set_field(registers, rcc + 0x88, 0b11U << 24, 0b10U << 24);     // CCIPR: FDCANSEL = PCLK1
  (void)registers.read(rcc + 0x58);  // two clocks pass before a peripheral answers (RCC, "peripheral clock enable")
  (void)registers.read(rcc + 0x58);
}

}  // namespace fxdyn::hal::stm32g4
