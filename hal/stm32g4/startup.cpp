// Vector table of the STM32G474 (RM0440, table "STM32G4 series vector table"): 102 interrupts.

#include "hal/cortex_m/startup.hpp"
#include "hal/stm32g4/board.hpp"

// An image that uses them defines them in its main file.
extern "C" [[gnu::weak]] void nmi_handler() { fault_handler(); }
extern "C" [[gnu::weak]] void fdcan1_handler() { fault_handler(); }
extern "C" [[gnu::weak]] void tim6_handler() { fault_handler(); }

namespace {

constexpr auto make_vectors() {
  auto table = fxdyn::hal::cortex_m::make_vectors<102>();
  table.exceptions[1] = nmi_handler;
  table.interrupts_[fxdyn::hal::stm32g4::fdcan1_interrupt] = fdcan1_handler;
  table.interrupts_[fxdyn::hal::stm32g4::tim6_interrupt] = tim6_handler;
  return table;
}

[[gnu::section(".vectors"), gnu::used]] constexpr auto vectors = make_vectors();

}  // namespace
