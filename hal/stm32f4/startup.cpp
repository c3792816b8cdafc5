// Vector table of the STM32F405 (RM0090, "Vector table for STM32F405xx/07xx"): 82 interrupts.

#include "hal/cortex_m/startup.hpp"
#include "hal/stm32f4/board.hpp"

// An image that receives defines it in its main file.
extern "C" [[gnu::weak]] void usart1_handler() { fault_handler(); }

namespace {

constexpr auto make_vectors() {
  auto table = fxdyn::hal::cortex_m::make_vectors<82>();
  table.interrupts_[fxdyn::hal::stm32f4::usart1_interrupt] = usart1_handler;
  return table;
}

[[gnu::section(".vectors"), gnu::used]] constexpr auto vectors = make_vectors();

}  // namespace
