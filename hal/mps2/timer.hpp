#pragma once

#include <atomic>
#include <cstdint>

#include "hal/clock.hpp"
#include "hal/cortex_m/core.hpp"
#include "hal/mps2/board.hpp"

namespace fxdyn::hal::mps2 {

/// TIMER0, whose interrupt counts the periods and wakes the processor. Registers: Cortex-M System Design Kit Technical
/// Reference Manual (DDI 0479), "APB timer". One instance, whose on_interrupt() the interrupt handler calls.
template <Registers R = MemoryMapped>
class BasicTimer {
 public:
  explicit constexpr BasicTimer(R registers = {}) : registers_(registers) {}

  Status start(std::uint32_t period_us) {
    constexpr std::uint32_t ticks_per_us = clock_hz / 1'000'000;
    if (period_us == 0 || period_us > UINT32_MAX / ticks_per_us) return Status::failed;
    registers_.write(control, 0);
    registers_.write(reload, period_us * ticks_per_us - 1);
    registers_.write(value, period_us * ticks_per_us - 1);
    registers_.write(control, interrupt_enable | enable);
    cortex_m::enable_interrupt(registers_, timer0_interrupt);
    return Status::ok;
  }
  std::uint32_t expired() {
    const std::uint32_t count = count_.load(std::memory_order_acquire);
    const std::uint32_t since = count - asked_;
    asked_ = count;
    return since;
  }
  void on_interrupt() {
    registers_.write(interrupt_status, 1);  // clears it
    count_.store(count_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }

 private:
  static constexpr Address control = timer0_address + 0x00, value = timer0_address + 0x04,
                           reload = timer0_address + 0x08, interrupt_status = timer0_address + 0x0c;
  static constexpr std::uint32_t enable = 1U << 0, interrupt_enable = 1U << 3;

  [[no_unique_address]] R registers_;
  std::atomic<std::uint32_t> count_{0};  // written by the interrupt
  std::uint32_t asked_ = 0;
};
using Timer = BasicTimer<>;
static_assert(TickTimer<Timer>);

/// The FPGA's prescaled counter (AN386, "FPGA system control and I/O": COUNTER, PRESCALE): one count a microsecond.
template <Registers R = MemoryMapped>
class BasicMicrosecondClock {
 public:
  explicit BasicMicrosecondClock(R registers = {}) : registers_(registers) {
    registers_.write(fpgaio_address + 0x1c, clock_hz / 1'000'000 - 1);
  }
  std::uint32_t now_us() { return registers_.read(fpgaio_address + 0x18); }

 private:
  [[no_unique_address]] R registers_;
};
using MicrosecondClock = BasicMicrosecondClock<>;
static_assert(Clock<MicrosecondClock>);

}  // namespace fxdyn::hal::mps2
