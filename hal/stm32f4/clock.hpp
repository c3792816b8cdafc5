#pragma once

#include <cstdint>

#include "hal/clock.hpp"
#include "hal/polled.hpp"
#include "hal/registers.hpp"
#include "hal/stm32/clock.hpp"
#include "hal/stm32f4/board.hpp"

namespace fxdyn::hal::stm32f4 {

/// RM0090, "Reset and clock control for STM32F405xx/07xx (RCC)", "Embedded flash memory interface": 168 MHz out of a
/// 25 MHz crystal (Netduino Plus 2), else out of the internal 16 MHz, else those 16 MHz as they are.
template <Registers R>
stm32::SystemClock start_clock(R registers = {}) {
  using stm32::ClockSource;
  constexpr std::uint32_t hse_on = 1U << 16, hse_ready = 1U << 17, pll_on = 1U << 24, pll_ready = 1U << 25;
  constexpr std::uint32_t switch_mask = 0b11, pll = 0b10;
  constexpr Address control = rcc + 0x00, pll_configuration = rcc + 0x04, configuration = rcc + 0x08;

  set_bits(registers, control, hse_on);
  const bool crystal = wait_for(registers, control, hse_ready, stm32::start_up_tries);
  if (!crystal) clear_bits(registers, control, hse_on);

  // VCO 336 MHz = 1 MHz * 336 or 2 MHz * 168, divided by P = 2; Q = 7 gives 48 MHz.
  set_field(registers, pll_configuration, 0x3fU | 0x1ffU << 6 | 0b11U << 16 | 1U << 22 | 0xfU << 24,
            (crystal ? 25U | 336U << 6 | 1U << 22 : 8U | 168U << 6) | 7U << 24);  // M, N, P, source, Q
  set_bits(registers, control, pll_on);
  if (!wait_for(registers, control, pll_ready, stm32::start_up_tries)) {
    clear_bits(registers, control, pll_on | hse_on);
    return {};
  }
  set_field(registers, flash, 0b111U, 5U | 1U << 8 | 1U << 9 | 1U << 10);  // ACR: 5 wait states, prefetch, caches
  if (!wait_for(registers, flash, 5, stm32::start_up_tries)) return {};
  // APB1 at most 42 MHz: a quarter; APB2 at most 84: half.
  set_field(registers, configuration, 0b111U << 10 | 0b111U << 13, 0b101U << 10 | 0b100U << 13);
  set_field(registers, configuration, switch_mask, pll);
  if (!wait_for(registers, configuration, pll << 2, stm32::start_up_tries)) {  // SWS
    clear_bits(registers, configuration, switch_mask | 0b111U << 10 | 0b111U << 13);
    return {};
  }
  return {crystal ? ClockSource::crystal : ClockSource::internal, 168};
}

/// Whether the independent watchdog made the last reset; asking forgets it (RCC_CSR: IWDGRSTF, RMVF).
template <Registers R>
bool reset_by_watchdog(R registers = {}) {
  const bool was = (registers.read(rcc + 0x74) & 1U << 29) != 0;
  set_bits(registers, rcc + 0x74, 1U << 24);
  return was;
}

/// Clocks of what the node uses: GPIOA, GPIOB, USART1.
template <Registers R>
void enable_peripherals(R registers = {}) {
  set_bits(registers, rcc + 0x30, 0b11);     // AHB1ENR
  set_bits(registers, rcc + 0x44, 1U << 4);  // APB2ENR
  (void)registers.read(rcc + 0x44);          // two clocks pass before a peripheral answers
}

/// SysTick (Armv7-M Architecture Reference Manual, B3.3) as a clock: 24 bits, so it has to be read every 0.1 s.
template <Registers R = MemoryMapped>
class BasicMicrosecondClock {
 public:
  explicit BasicMicrosecondClock(stm32::SystemClock clock, R registers = {})
      : registers_(registers), time_(clock.mhz == 168 ? full_speed : slow) {
    registers_.write(0xe000'e014, 0x00ff'ffff);  // SYST_RVR
    registers_.write(0xe000'e018, 0);            // SYST_CVR: any write clears it
    registers_.write(0xe000'e010, 0b101);        // SYST_CSR: processor clock, no interrupt
  }
  std::uint32_t now_us() { return time_.now(0U - registers_.read(0xe000'e018)); }  // it counts down

 private:
  using Time = Microseconds<24>;
  static constexpr Time::Rate full_speed{168'000'000}, slow{16'000'000};
  [[no_unique_address]] R registers_;
  Time time_;
};
using MicrosecondClock = BasicMicrosecondClock<>;
static_assert(Clock<MicrosecondClock>);
using Timer = PolledTimer<MicrosecondClock>;  ///< the node of this board polls: nothing needs to wake it
static_assert(TickTimer<Timer>);

}  // namespace fxdyn::hal::stm32f4
