#pragma once

#include <atomic>
#include <cstdint>

#include "hal/clock.hpp"
#include "hal/cortex_m/core.hpp"
#include "hal/stm32/clock.hpp"
#include "hal/stm32g4/board.hpp"

// RM0440, "General-purpose timers (TIM2/TIM3/TIM4/TIM5)" and "Basic timers (TIM6/TIM7)".

namespace fxdyn::hal::stm32g4 {

namespace detail {
inline constexpr Address control = 0x00, interrupts = 0x0c, status = 0x10, event = 0x14, counter = 0x24,
                         prescaler = 0x28, auto_reload = 0x2c;
}

/// TIM2: 32 bits, one count a microsecond.
template <Registers R = MemoryMapped>
class BasicMicrosecondClock {
 public:
  explicit BasicMicrosecondClock(stm32::SystemClock clock, R registers = {}) : registers_(registers) {
    registers_.write(tim2 + detail::prescaler, clock.mhz - 1);
    registers_.write(tim2 + detail::auto_reload, UINT32_MAX);
    registers_.write(tim2 + detail::event, 1);    // UG: takes the prescaler now
    registers_.write(tim2 + detail::control, 1);  // CEN
  }
  std::uint32_t now_us() { return registers_.read(tim2 + detail::counter); }

 private:
  [[no_unique_address]] R registers_;
};
using MicrosecondClock = BasicMicrosecondClock<>;
static_assert(Clock<MicrosecondClock>);

/// TIM6: the interrupt counts the periods and wakes the processor; periods up to 65 ms.
template <Registers R = MemoryMapped>
class BasicTimer {
 public:
  explicit constexpr BasicTimer(R registers = {}) : registers_(registers) {}

  /// Before start(): the clock that the prescaler divides.
  void set_clock(stm32::SystemClock clock) { mhz_ = clock.mhz; }

  Status start(std::uint32_t period_us) {
    if (period_us == 0 || period_us > 0x10000) return Status::failed;
    registers_.write(tim6 + detail::prescaler, mhz_ - 1);
    registers_.write(tim6 + detail::auto_reload, period_us - 1);
    registers_.write(tim6 + detail::event, 1);       // UG
    registers_.write(tim6 + detail::status, 0);      // UG has set UIF
    registers_.write(tim6 + detail::interrupts, 1);  // UIE
    registers_.write(tim6 + detail::control, 1);     // CEN
    cortex_m::enable_interrupt(registers_, tim6_interrupt);
    return Status::ok;
  }
  std::uint32_t expired() {
    const std::uint32_t count = count_.load(std::memory_order_acquire);
    const std::uint32_t since = count - asked_;
    asked_ = count;
    return since;
  }
  void on_interrupt() {
    registers_.write(tim6 + detail::status, 0);
    count_.store(count_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }

 private:
  [[no_unique_address]] R registers_;
  std::uint32_t mhz_ = 16;
  std::atomic<std::uint32_t> count_{0};  // written by the interrupt
  std::uint32_t asked_ = 0;
};
using Timer = BasicTimer<>;
static_assert(TickTimer<Timer>);

}  // namespace fxdyn::hal::stm32g4
