// The drive node on an STM32G474 (Nucleo-G474RE and a CAN FD transceiver): nothing but the wiring.
//   PA11 CAN RX, PA12 CAN TX; PB4 enable in (high: torque may go out), PB5 fault out, PB6 tick-busy out

#include FXDYN_TABLES_HEADER

#include "firmware/drive_node.hpp"
#include "firmware/flash_tables.hpp"
#include "hal/stm32/gpio.hpp"
#include "hal/stm32/watchdog.hpp"
#include "hal/stm32g4/clock.hpp"
#include "hal/stm32g4/fdcan.hpp"
#include "hal/stm32g4/timer.hpp"

namespace {
namespace board = fxdyn::hal::stm32g4;
namespace stm32 = fxdyn::hal::stm32;
using fxdyn::hal::MemoryMapped;
using fxdyn::tables::Model;

constexpr fxdyn::RatedTorques<Model> rated{fxdyn::tables::rated_torque};
constexpr std::uint32_t bit_rate = 1'000'000, data_bit_rate = 2'000'000;
constexpr auto timing_at_170_mhz = board::fdcan_timing(170'000'000, bit_rate, data_bit_rate);
constexpr auto timing_at_16_mhz = board::fdcan_timing(16'000'000, bit_rate, data_bit_rate);
constinit board::Fdcan can;
constinit board::Timer wake_up;
}  // namespace

extern "C" void fdcan1_handler() { can.on_receive(); }
extern "C" void tim6_handler() { wake_up.on_interrupt(); }

int main() {
  const stm32::SystemClock system = board::start_clock<MemoryMapped>();
  const bool watchdog_reset = board::reset_by_watchdog<MemoryMapped>();
  board::enable_peripherals<MemoryMapped>();
  const auto tables = fxdyn::tables_in_flash(fxdyn::tables::page);
  board::MicrosecondClock clock(system);
  fxdyn::hal::cortex_m::CycleCounter counter;
  stm32::Watchdog watchdog;
  stm32::InputPin<board::gpio_b, 4, true> enable;
  stm32::OutputPin<board::gpio_b, 5, true> fault;
  stm32::OutputPin<board::gpio_b, 6, true> tick_busy;
  MemoryMapped registers;
  stm32::use_alternate_function(registers, board::gpio_a, 11, 9);
  stm32::use_alternate_function(registers, board::gpio_a, 12, 9);
  static fxdyn::DriveHardware hardware{can, clock, counter, watchdog, enable, fault, tick_busy};
  using Node = fxdyn::DriveNode<Model, decltype(hardware)>;
  using fxdyn::hal::Status;
  namespace part = fxdyn::hardware_part;
  std::uint8_t failed = 0;
  if (can.start(system.mhz == 170 ? timing_at_170_mhz : timing_at_16_mhz) != Status::ok) failed |= part::can;
  wake_up.set_clock(system);
  if (wake_up.start(Node::longest_sleep_us) != Status::ok) failed |= part::wake_up_timer;
  if (watchdog.start(50) != Status::ok) failed |= part::watchdog;
  static Node node(hardware, {tables.page.parameters, tables.page.header, tables.valid, tables.is_update, rated},
                   {.board = FXDYN_BOARD_NAME, .watchdog_reset = watchdog_reset, .hardware_failed = failed});
  for (;;) {
    if (!node.poll()) can.wait();
  }
}
