// The drive node on a Cortex-R5F of the Zynq UltraScale+, behind its CAN controller 0: nothing but the wiring. Clocks
// and pins are the boot loader's.
//   MIO 13 enable in (low: torque may go out), MIO 14 fault out (low: fault), MIO 15 tick-busy out

#include FXDYN_TABLES_HEADER

#include "firmware/drive_node.hpp"
#include "firmware/flash_tables.hpp"
#include "hal/absent.hpp"
#include "hal/zynqmp_r5/clock.hpp"
#include "hal/zynqmp_r5/gpio.hpp"
#include "hal/zynqmp_r5/watchdog.hpp"
#include "hal/zynqmp_r5/xcan.hpp"

namespace {
namespace board = fxdyn::hal::zynqmp_r5;
using fxdyn::hal::Status;
using fxdyn::tables::Model;

constexpr fxdyn::RatedTorques<Model> rated{fxdyn::tables::rated_torque};
constexpr std::uint32_t bit_rate = 1'000'000;
constexpr auto timing = fxdyn::hal::bit_timing(board::can_limits, board::can_clock_hz, {.bits_per_second = bit_rate});

#ifdef FXDYN_QEMU
constexpr auto format = board::FrameFormat::qemu_7;
// QEMU 7.2 has neither GPIO nor watchdog there: an access would be an abort.
using Enable = fxdyn::hal::FixedInput;
struct Fault : fxdyn::hal::AbsentOutput {
  explicit Fault(fxdyn::hal::AtStart) {}
};
using TickBusy = fxdyn::hal::AbsentOutput;
struct Watchdog : fxdyn::hal::AbsentWatchdog {
  Status start(std::uint32_t) { return Status::ok; }
};
#else
constexpr auto format = board::FrameFormat::controller;
using Enable = board::InputPin<13, false>;
using Fault = board::OutputPin<14, false>;
using TickBusy = board::OutputPin<15, true>;
using Watchdog = board::Watchdog;
#endif
}  // namespace

int main() {
  const auto tables = fxdyn::tables_in_flash(fxdyn::tables::page);
  board::MicrosecondClock clock;
  board::CycleCounter counter;
  Watchdog watchdog;
  Enable enable;
  Fault fault(fxdyn::hal::AtStart::on);
  TickBusy tick_busy;
  board::BasicXcan<format, board::MicrosecondClock> can(clock);
  namespace part = fxdyn::hardware_part;
  std::uint8_t failed = 0;
  if (can.start(timing, bit_rate / 1000) != Status::ok) failed |= part::can;
  if (watchdog.start(50) != Status::ok) failed |= part::watchdog;
  static fxdyn::DriveHardware hardware{can, clock, counter, watchdog, enable, fault, tick_busy};
  static fxdyn::DriveNode<Model, decltype(hardware)> node(
      hardware, {tables.page.parameters, tables.header, tables.valid, tables.update, rated},
      {.board = FXDYN_BOARD_NAME, .hardware_failed = failed});
  for (;;) static_cast<void>(node.poll());
}
