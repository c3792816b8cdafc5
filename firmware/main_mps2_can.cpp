// The drive node on an Arm MPS2 board, its CAN bus an SLCAN line over UART0: nothing but the wiring.
//   EXP1 enable in (low: torque may go out), EXP2 fault out (low: fault), EXP3 tick-busy out

#include FXDYN_TABLES_HEADER

#include "firmware/drive_node.hpp"
#include "firmware/flash_tables.hpp"
#include "hal/mps2/gpio.hpp"
#include "hal/mps2/systick.hpp"
#include "hal/mps2/timer.hpp"
#include "hal/mps2/uart.hpp"
#include "hal/mps2/watchdog.hpp"
#include "hal/slcan.hpp"
#ifdef FXDYN_TICK_BUSY_HEADER  // of a test: a TickBusy that does more than show the tick
#include FXDYN_TICK_BUSY_HEADER
#endif

namespace {
namespace mps2 = fxdyn::hal::mps2;
using fxdyn::tables::Model;

constexpr fxdyn::RatedTorques<Model> rated{fxdyn::tables::rated_torque};
constinit mps2::Uart uart;
constinit mps2::Timer wake_up;
constinit mps2::Watchdog watchdog;

#ifdef FXDYN_EXACT_COUNTS  // to measure with, in an emulator
using Counter = mps2::ExactSysTick;
#else
using Counter = mps2::SysTick;
#endif
#ifndef FXDYN_TICK_BUSY_HEADER
using TickBusy = mps2::OutputPin<3, true>;
#endif
}  // namespace

extern "C" void uart0_receive_handler() { uart.on_receive(); }
extern "C" void timer0_handler() { wake_up.on_interrupt(); }
extern "C" [[noreturn]] void watchdog_handler() {
  watchdog.on_time_out();
  for (;;) asm volatile("");  // nothing feeds it here, so that the second time-out resets
}

int main() {
  const auto tables = fxdyn::tables_in_flash(fxdyn::tables::page);
  uart.start();
  mps2::MicrosecondClock clock;
  Counter counter;
  mps2::InputPin<1, false> enable;  // active low: an emulator's pins read as 0
  mps2::OutputPin<2, false> fault(fxdyn::hal::AtStart::on);
  TickBusy tick_busy;
  static fxdyn::hal::SlcanBus bus(uart);
  static fxdyn::DriveHardware hardware{bus, clock, counter, watchdog, enable, fault, tick_busy};
  using Node = fxdyn::DriveNode<Model, decltype(hardware)>;
  const bool watchdog_reset = watchdog.made_the_reset();
  watchdog.start(1'000'000);  // an emulator on a loaded machine stands still for a while
  const bool wakes_up = wake_up.start(Node::longest_sleep_us) == fxdyn::hal::Status::ok;
  static Node node(hardware, {tables.page.parameters, tables.header, tables.valid, tables.update, rated},
                   {.board = FXDYN_BOARD_NAME,
                    .watchdog_reset = watchdog_reset,
                    .hardware_failed = wakes_up ? std::uint8_t{0} : fxdyn::hardware_part::wake_up_timer});
  for (;;) {
    if (!node.poll() && bus.idle()) uart.wait_for_line();
  }
}
