#pragma once

#include <cstdint>

#include "hal/clock.hpp"
#include "hal/registers.hpp"
#include "hal/stm32/clock.hpp"
#include "hal/stm32g4/board.hpp"

namespace fxdyn::hal::stm32g4 {

/// 168 and not 170 MHz: of 170 = 2 * 5 * 17 no divider of the chip leaves a multiple of 4 MHz, and the crystal itself
/// makes 6 quanta of a bit of 4 Mbit/s. Half of 168 makes 84, 42 and 21 quanta of 1, 2 and 4 Mbit/s, all with a
/// prescaler of 1, as the controller wants it to measure the transceiver's delay.
inline constexpr std::uint32_t full_speed_mhz = 168;
inline constexpr std::uint32_t fdcan_full_speed_hz = 84'000'000, fdcan_slow_hz = 16'000'000;

/// How far the clock may be off, in millionths. Crystal: cut, temperature, ageing and load of what a Nucleo has.
/// Internal: data sheet, "HSI16 oscillator characteristics", the worst of 0 to 85 degrees: 0.75 % as trimmed, 1 % by
/// temperature, 0.1 % by the supply.
inline constexpr std::uint32_t crystal_ppm = 100, internal_ppm = 18'500;

/// RM0440, "Reset and clock control (RCC)", "Power control (PWR)", "Embedded flash memory": 168 MHz out of a 24 MHz
/// crystal (Nucleo-G474RE), else out of the internal 16 MHz, else those 16 MHz as they are. The PLL's output Q has the
/// 84 MHz of the CAN controller.
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

  // VCO 336 MHz = 4 MHz * 84, divided by R = 2 and Q = 4. The input of 4 MHz: 24 / 6 or 16 / 4.
  const std::uint32_t source_and_m = crystal ? 0b11U | (6 - 1) << 4 : 0b10U | (4 - 1) << 4;
  clear_bits(registers, control, pll_on);
  if (!wait_for(registers, control, pll_ready, stm32::start_up_tries, true)) return {};
  set_field(registers, pll_configuration, 0b11U | 0xfU << 4 | 0x7fU << 8 | 0b11U << 21 | 0b11U << 25,
            source_and_m | 84U << 8 | 1U << 20 | 0b01U << 21 | 1U << 24);  // source, M, N, QEN, Q = 4, REN, R = 2
  set_bits(registers, control, pll_on);
  if (!wait_for(registers, control, pll_ready, stm32::start_up_tries)) {
    clear_bits(registers, control, pll_on | hse_on);
    return {};
  }

  // Above 150 MHz: range 1 with boost. Flash: 4 wait states (RM0440, table "Number of wait states") and caches. No
  // prefetch: whether what it fetches gets into the cache RM0440 leaves open, and a tick takes 7 % less or 16 % more
  // (docs/findings/2026-11-23-cycles.md).
  clear_bits(registers, pwr + 0x80, 1U << 8);  // CR5: R1MODE = 0
  // Only these fields of ACR: DBG_SWEN beside them, set by reset, keeps the debug port open.
  set_field(registers, flash, 0xfU | 1U << 8, 4U | 1U << 9 | 1U << 10);
  if (!wait_for(registers, flash, 4, stm32::start_up_tries)) return {};
  // From 16 to 168 MHz by way of 84 for at least 1 us ("system clock switch above 80 MHz").
  set_field(registers, configuration, ahb_mask, half_ahb);
  set_field(registers, configuration, switch_mask, pll);
  if (!wait_for(registers, configuration, pll << 2, stm32::start_up_tries)) {  // SWS
    set_field(registers, configuration, switch_mask | ahb_mask, hsi);
    return {};
  }
  for (int i = 0; i < 42; ++i) (void)registers.read(configuration);  // 1 us at 84 MHz with two cycles a read
  clear_bits(registers, configuration, ahb_mask);
  return {crystal ? ClockSource::crystal : ClockSource::internal, full_speed_mhz};
}

/// Whether the independent watchdog made the last reset; asking forgets it (RCC_CSR: IWDGRSTF, RMVF).
template <Registers R>
bool reset_by_watchdog(R registers = {}) {
  const bool was = (registers.read(rcc + 0x94) & 1U << 29) != 0;
  set_bits(registers, rcc + 0x94, 1U << 23);
  return was;
}

/// Clocks of what the node uses: GPIOA, GPIOB, TIM2, TIM6, FDCAN. Then PB4 and PB6 are let go of: after reset they are
/// USB Type-C lines as well, and with a high level on PA10 or PA9 a pull-down of 5.1 kOhm each, for a host with a dead
/// battery (RM0440, PWR_CR3).
template <Registers R>
void enable_peripherals(stm32::SystemClock clock, R registers = {}) {
  constexpr std::uint32_t tim2_on = 1U << 0, tim6_on = 1U << 4, fdcan_on = 1U << 25, pwr_on = 1U << 28;
  constexpr std::uint32_t pll_q = 0b01U << 24, pclk1 = 0b10U << 24, fdcan_clock = 0b11U << 24;  // CCIPR: FDCANSEL
  set_field(registers, rcc + 0x88, fdcan_clock, clock.mhz == full_speed_mhz ? pll_q : pclk1);
  set_bits(registers, rcc + 0x4c, 0b11);                                   // AHB2ENR: GPIOAEN, GPIOBEN
  set_bits(registers, rcc + 0x58, tim2_on | tim6_on | fdcan_on | pwr_on);  // APB1ENR1
  (void)registers.read(rcc + 0x58);  // two clocks pass before a peripheral answers (RCC, "peripheral clock enable")
  (void)registers.read(rcc + 0x58);
  set_bits(registers, pwr + 0x08, 1U << 14);  // CR3: UCPD1_DBDIS
}

}  // namespace fxdyn::hal::stm32g4
