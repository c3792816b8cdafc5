// The drive node on an STM32F405 (Netduino Plus 2), its CAN bus an SLCAN line over USART1: nothing but the wiring.
//   PA9 TX, PA10 RX; PB4 enable in (low: torque may go out), PB5 fault out (low: fault), PB6 tick-busy out

#include FXDYN_TABLES_HEADER

#include "firmware/drive_node.hpp"
#include "firmware/flash_tables.hpp"
#include "hal/slcan.hpp"
#include "hal/stm32/gpio.hpp"
#include "hal/stm32f4/clock.hpp"
#include "hal/stm32f4/usart.hpp"
#include "hal/stm32f4/watchdog.hpp"

namespace {
namespace board = fxdyn::hal::stm32f4;
namespace stm32 = fxdyn::hal::stm32;
using fxdyn::hal::MemoryMapped;
using fxdyn::tables::Model;

constexpr fxdyn::RatedTorques<Model> rated{fxdyn::tables::rated_torque};
constexpr std::uint32_t watchdog_ms = 50;
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
  board::Watchdog watchdog;
  stm32::InputPin<board::gpio_b, 4, false> enable;  // active low: an emulator's pins read as 0
  stm32::OutputPin<board::gpio_b, 5, false> fault(fxdyn::hal::AtStart::on);
  stm32::OutputPin<board::gpio_b, 6, true> tick_busy;
  MemoryMapped registers;
  stm32::use_alternate_function(registers, board::gpio_a, 9, 7);
  stm32::use_alternate_function(registers, board::gpio_a, 10, 7);
  usart.start(system);
  static fxdyn::hal::SlcanBus bus(usart);
  static fxdyn::DriveHardware hardware{bus, clock, counter, watchdog, enable, fault, tick_busy};
  namespace part = fxdyn::hardware_part;
  std::uint8_t failed = system.source == stm32::ClockSource::crystal ? 0 : part::crystal;
  if (watchdog.start(watchdog_ms) != fxdyn::hal::Status::ok) failed |= part::watchdog;
  // The hardware version (0x1009) says what it runs from.
  constexpr std::array<std::string_view, 3> names{FXDYN_BOARD_NAME " HSE", FXDYN_BOARD_NAME " HSI PLL",
                                                  FXDYN_BOARD_NAME " HSI"};
  static fxdyn::DriveNode<Model, decltype(hardware)> node(
      hardware, {tables.page.parameters, tables.header, tables.valid, tables.update, rated},
      {.board = names[static_cast<std::size_t>(system.source)],
       .watchdog_reset = watchdog_reset,
       .hardware_failed = failed});
  for (;;) static_cast<void>(node.poll());
}
