// The drive node on an Arm MPS2 board, its CAN bus an SLCAN line over UART0: nothing but the wiring.

#include FXDYN_TABLES_HEADER

#include "firmware/drive_node.hpp"
#include "firmware/flash_tables.hpp"
#include "hal/mps2/gpio.hpp"
#include "hal/mps2/systick.hpp"
#include "hal/mps2/timer.hpp"
#include "hal/mps2/uart.hpp"
#include "hal/mps2/watchdog.hpp"
#include "hal/slcan.hpp"

namespace {
namespace mps2 = fxdyn::hal::mps2;
using fxdyn::tables::Model;

constexpr fxdyn::RatedTorques<Model> rated{fxdyn::tables::rated_torque};
constinit mps2::Uart uart;
constinit mps2::Timer wake_up;
}  // namespace

extern "C" void uart0_receive_handler() { uart.on_receive(); }
extern "C" void timer0_handler() { wake_up.on_interrupt(); }

int main() {
  const auto tables = fxdyn::tables_in_flash(fxdyn::tables::page);
  uart.start();
  mps2::MicrosecondClock clock;
  mps2::SysTick counter;
  mps2::Watchdog watchdog;
  mps2::InputPin<1, false> enable;  // active low: an emulator's pins read as 0
  mps2::OutputPin<2, true> fault;
  mps2::OutputPin<3, true> tick_busy;
  static fxdyn::hal::SlcanBus bus(uart);
  static fxdyn::DriveHardware hardware{bus, clock, counter, watchdog, enable, fault, tick_busy};
  // Nothing here tells a reset by the watchdog from another one, so EMCY 0x6010 is left to boards that can.
  static fxdyn::DriveNode<Model, decltype(hardware)> node(
      hardware, {tables.page.parameters, tables.page.header, tables.valid, tables.is_update, rated},
      {.board = FXDYN_BOARD_NAME});
  static_cast<void>(wake_up.start(node.longest_sleep_us));
  watchdog.start(1'000'000);  // an emulator on a loaded machine stands still for a while
  for (;;) {
    if (!node.poll() && bus.idle()) uart.wait_for_line();
  }
}
