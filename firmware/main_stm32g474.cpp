// The drive node on an STM32G474 (Nucleo-G474RE and a CAN FD transceiver): nothing but the wiring.
//   PA11 CAN RX, PA12 CAN TX; PB4 enable in (high: torque may go out), PB5 fault out (low: fault), PB6 tick-busy out

#include FXDYN_TABLES_HEADER

#include "firmware/drive_node.hpp"
#include "firmware/flash_tables.hpp"
#include "hal/stm32g4/drive_board.hpp"
#include "hal/stm32g4/flash.hpp"
#include "hal/stm32g4/watchdog.hpp"

namespace {
namespace board = fxdyn::hal::stm32g4;
using fxdyn::hal::Status;
using fxdyn::hal::stm32::ClockSource;
using fxdyn::tables::Model;
namespace part = fxdyn::hardware_part;

constexpr fxdyn::RatedTorques<Model> rated{fxdyn::tables::rated_torque};
constexpr std::uint32_t bit_rate = 1'000'000;
using Bus = board::BusTimings<bit_rate, FXDYN_DATA_BIT_RATE>;  // the latter from CMake
constexpr std::uint32_t watchdog_ms = 50;
constinit board::Fdcan can;
constinit board::Timer wake_up;
constinit board::FlashEcc flash_ecc;
/// Of start-up. Both pages, each as large as the slot, take a quarter of a second to read at 16 MHz.
constexpr std::uint32_t start_up_ms = 450;
static_assert(start_up_ms <= board::Watchdog::most_ms);
}  // namespace

extern "C" [[noreturn]] void fault_handler();
extern "C" void nmi_handler() {
  if (!flash_ecc.on_nmi()) fault_handler();
}
extern "C" void fdcan1_handler() { can.on_receive(); }
extern "C" void tim6_handler() { wake_up.on_interrupt(); }

int main() {
  board::DriveBoard chip;  // clocks and pins; the fault output is asserted until the node knows better
  // Before the tables, which may be unreadable, and again below with the time of a tick.
  board::Watchdog watchdog;
  static_cast<void>(watchdog.start(start_up_ms));
  const auto tables = fxdyn::tables_in_flash(fxdyn::tables::page, flash_ecc);
  fxdyn::hal::cortex_m::CycleCounter counter;
  static fxdyn::DriveHardware hardware{can, chip.clock, counter, watchdog, chip.enable, chip.fault, chip.tick_busy};
  using Node = fxdyn::DriveNode<Model, decltype(hardware)>;
  std::uint8_t failed = chip.system.source == ClockSource::crystal ? 0 : part::crystal;
  if (can.start(Bus::of(chip.system)) != Status::ok) failed |= part::can;
  wake_up.set_clock(chip.system);
  if (wake_up.start(Node::longest_sleep_us) != Status::ok) failed |= part::wake_up_timer;
  if (watchdog.start(watchdog_ms) != Status::ok) failed |= part::watchdog;
  static Node node(hardware, {tables.page.parameters, tables.header, tables.valid, tables.update, rated},
                   {.board = FXDYN_BOARD_NAME,
                    .watchdog_reset = chip.watchdog_reset,
                    .hardware_failed = failed,
                    .fd_allowed = Bus::fd_allowed(chip.system)});
  for (;;) {
    if (!node.poll()) can.wait();
  }
}
