// The drive node on an Arm MPS2 board: nothing but the wiring.

#include FXDYN_TABLES_HEADER

#include "firmware/replay_node.hpp"
#include "hal/mps2/systick.hpp"
#include "hal/mps2/uart.hpp"

// The slot for updated tables, from the linker script.
extern "C" const std::uint32_t fxdyn_update_begin[];  // NOLINT

namespace {
constinit fxdyn::hal::mps2::Uart uart;

/// The page as the flash holds it: hides from the compiler that it knows the values, since tables can be reflashed
/// alone.
const auto& tables_in_flash() {
  const auto* built_in = &fxdyn::tables::page;
  const auto* update =
      reinterpret_cast<decltype(built_in)>(fxdyn_update_begin);  // NOLINT: whatever the flash has there
  asm volatile("" : "+r"(built_in), "+r"(update));
  return fxdyn::newest_valid_page(*update, *built_in);
}
}  // namespace

extern "C" void uart0_receive_handler() { uart.on_receive(); }

int main() {
  const auto& page = tables_in_flash();
  uart.start();
  fxdyn::hal::mps2::SysTick counter;
  static fxdyn::ReplayNode<fxdyn::tables::Model, fxdyn::hal::mps2::Uart, fxdyn::hal::mps2::SysTick> node(
      uart, counter, page.parameters, {page.header.layout_hash, page.header.crc32, fxdyn::page_is_valid(page)});
  for (;;) {
    if (!node.poll()) uart.wait();
  }
}
