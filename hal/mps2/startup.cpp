// Vector table of the MPS2 boards.

#include <algorithm>

#include "hal/cortex_m/startup.hpp"
#include "hal/mps2/board.hpp"

// An image that receives, or that uses the timer, defines them in its main file.
extern "C" [[gnu::weak]] void uart0_receive_handler() { fault_handler(); }
extern "C" [[gnu::weak]] void timer0_handler() { fault_handler(); }

// The watchdog's first time-out: nothing feeds it here, so that its second one resets.
extern "C" [[gnu::weak, noreturn]] void watchdog_handler() {
  for (;;) asm volatile("");
}

namespace {

using namespace fxdyn::hal::mps2;

constexpr auto make_vectors() {
  auto table = fxdyn::hal::cortex_m::make_vectors<std::max(uart0_receive_interrupt, timer0_interrupt) + 1>();
  table.exceptions[1] = watchdog_handler;  // NMI
  table.interrupts_[uart0_receive_interrupt] = uart0_receive_handler;
  table.interrupts_[timer0_interrupt] = timer0_handler;
  return table;
}

[[gnu::section(".vectors"), gnu::used]] constexpr auto vectors = make_vectors();

}  // namespace
