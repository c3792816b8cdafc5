// Vector table of the MPS2 boards.

#include "hal/cortex_m/startup.hpp"
#include "hal/mps2/board.hpp"

// An image that receives defines it in its main file.
extern "C" [[gnu::weak]] void uart0_receive_handler() { fault_handler(); }

namespace {

constexpr auto make_vectors() {
  auto table = fxdyn::hal::cortex_m::make_vectors<fxdyn::hal::mps2::uart0_receive_interrupt + 1>();
  table.interrupts_.back() = uart0_receive_handler;
  return table;
}

[[gnu::section(".vectors"), gnu::used]] constexpr auto vectors = make_vectors();

}  // namespace
