// The drive node on an STM32F405 (Netduino Plus 2), its CAN bus an SLCAN line over USART1: nothing but the wiring.
//   PA9 TX, PA10 RX; PB4 enable in (low: torque may go out), PB5 fault out, PB6 tick-busy out

#include FXDYN_TABLES_HEADER

#include "firmware/drive_node.hpp"
#include "firmware/flash_tables.hpp"
#include "hal/slcan.hpp"
#include "hal/stm32/gpio.hpp"
#include "hal/stm32/watchdog.hpp"
#include "hal/stm32f4/clock.hpp"
#include "hal/stm32f4/usart.hpp"

namespace {
namespace board = fxdyn::hal::stm32f4;
namespace stm32 = fxdyn::hal::stm32;
using fxdyn::hal::MemoryMapped;
using fxdyn::tables::Model;

constexpr fxdyn::RatedTorques<Model> rated{fxdyn::tables::rated_torque};
constinit board::Usart usart;
}  // namespace

extern "C" void usart1_handler() { usart.on_receive(); }

int main() {
  const stm32::SystemClock system = board::start_clock<MemoryMapped>();
  const bool watchdog_reset = board::reset_by_watchdog<MemoryMapped>();
  board::enable_peripherals<MemoryMapped>();
  const auto tables = fxdyn::tables_in_flash(fxdyn::tables::page);
  board::MicrosecondClock clock(system);
  fxdyn::hal::cortex_m::CycleCounter counter;
  stm32::Watchdog watchdog;
  stm32::InputPin<board::gpio_b, 4, false> enable;  // active low: an emulator's pins read as 0
  stm32::OutputPin<board::gpio_b, 5, true> fault;
  stm32::OutputPin<board::gpio_b, 6, true> tick_busy;
  MemoryMapped registers;
  stm32::use_alternate_function(registers, board::gpio_a, 9, 7);
  stm32::use_alternate_function(registers, board::gpio_a, 10, 7);
  usart.start(system);
  static fxdyn::hal::SlcanBus bus(usart);
  static fxdyn::DriveHardware hardware{bus, clock, counter, watchdog, enable, fault, tick_busy};
  const std::uint8_t failed = watchdog.start(50) == fxdyn::hal::Status::ok ? 0 : fxdyn::hardware_part::watchdog;
  // The hardware version (0x1009) says what it runs from: where there is no crystal, a host can see it.
  constexpr std::array<std::string_view, 3> names{FXDYN_BOARD_NAME " HSE", FXDYN_BOARD_NAME " HSI PLL",
                                                  FXDYN_BOARD_NAME " HSI"};
  static fxdyn::DriveNode<Model, decltype(hardware)> node(
      hardware, {tables.page.parameters, tables.page.header, tables.valid, tables.is_update, rated},
      {.board = names[static_cast<std::size_t>(system.source)],
       .watchdog_reset = watchdog_reset,
       .hardware_failed = failed});
  for (;;) static_cast<void>(node.poll());
}
