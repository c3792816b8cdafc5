// The replay node on an Arm MPS2 board: nothing but the wiring.

#include FXDYN_TABLES_HEADER

#include "firmware/flash_tables.hpp"
#include "firmware/replay_node.hpp"
#include "hal/mps2/systick.hpp"
#include "hal/mps2/uart.hpp"

namespace {
constinit fxdyn::hal::mps2::Uart uart;
}

extern "C" void uart0_receive_handler() { uart.on_receive(); }

int main() {
  const auto tables = fxdyn::tables_in_flash(fxdyn::tables::page);
  uart.start();
  // Its costs are compared exactly. Masked interrupts do no harm: the host sends nothing until it has its answer.
  using Counter = fxdyn::hal::mps2::ExactSysTick;
  Counter counter;
  static fxdyn::ReplayNode<fxdyn::tables::Model, fxdyn::hal::mps2::Uart, Counter> node(
      uart, counter, tables.page.parameters, {tables.header.layout_hash, tables.header.crc32, tables.valid});
  for (;;) {
    if (!node.poll()) uart.wait();
  }
}
