#pragma once

#include <cstdint>

#include "hal/stm32/gpio.hpp"
#include "hal/stm32g4/clock.hpp"
#include "hal/stm32g4/fdcan.hpp"
#include "hal/stm32g4/timer.hpp"

namespace fxdyn::hal::stm32g4 {

/// What a bit on the bus takes there and back at most: two transceivers' loop delays (215 ns of those made for
/// 5 Mbit/s) and 27 m of cable, 5 ns a metre.
inline constexpr std::uint32_t propagation_ns = 700;

/// How far the clock of every node may be off, in millionths, from 84 MHz: classic frames, and FD frames.
consteval std::uint32_t classic_tolerance_ppm(FdcanTiming timing) {
  return clock_tolerance_ppm(timing.nominal, propagation_quanta(timing.nominal, fdcan_full_speed_hz, propagation_ns));
}
consteval std::uint32_t fd_tolerance_ppm(FdcanTiming timing) {
  return clock_tolerance_ppm(timing.nominal, timing.data,
                             propagation_quanta(timing.nominal, fdcan_full_speed_hz, propagation_ns));
}

/// The bit timings that the clocks of start_clock() need, and what they bear.
template <std::uint32_t bit_rate, std::uint32_t data_bit_rate>
struct BusTimings {
  static constexpr FdcanTiming full_speed = fdcan_timing(fdcan_full_speed_hz, bit_rate, data_bit_rate);
  /// FD frames are the others' there, so that four quanta a bit have to do.
  static constexpr FdcanTiming slow = fdcan_timing(fdcan_slow_hz, bit_rate, data_bit_rate, 4);
  static_assert(fd_tolerance_ppm(full_speed) >= crystal_ppm, "no crystal is exact enough for this bit timing");
  static constexpr bool internal_bears_fd = fd_tolerance_ppm(full_speed) >= internal_ppm;

  static constexpr const FdcanTiming& of(stm32::SystemClock clock) {
    return clock.mhz == full_speed_mhz ? full_speed : slow;
  }
  static constexpr bool fd_allowed(stm32::SystemClock clock) {
    return clock.source == stm32::ClockSource::crystal || internal_bears_fd;
  }
};

/// What a drive has of the chip, up to its pins: clocks first, then the peripherals', then everything that is behind
/// them. The pins are as the reset leaves them until then: PB4 pulled up as NJTRST, the others not connected.
///   PA11 CAN RX, PA12 CAN TX; PB4 enable in (high: torque may go out), PB5 fault out (low: fault), PB6 tick-busy out
template <Registers R = MemoryMapped>
class DriveBoard {
 public:
  explicit DriveBoard(R registers = {})
      : system(start(registers)),
        watchdog_reset(reset_by_watchdog(registers)),
        clock(system, registers),
        enable(registers),
        fault(AtStart::on, registers),
        tick_busy(registers) {
    constexpr std::uint32_t fdcan1_function = 9;
    stm32::use_alternate_function(registers, gpio_a, 11, fdcan1_function);
    stm32::use_alternate_function(registers, gpio_a, 12, fdcan1_function);
  }

  stm32::SystemClock system;
  bool watchdog_reset;
  BasicMicrosecondClock<R> clock;
  stm32::InputPin<gpio_b, 4, true, R> enable;
  stm32::OutputPin<gpio_b, 5, false, R> fault;
  stm32::OutputPin<gpio_b, 6, true, R> tick_busy;

 private:
  static stm32::SystemClock start(R registers) {
    const stm32::SystemClock clock = start_clock(registers);
    enable_peripherals(clock, registers);
    return clock;
  }
};

}  // namespace fxdyn::hal::stm32g4
