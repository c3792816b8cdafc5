#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/cortex_m/core.hpp"
#include "hal/mps2/board.hpp"
#include "hal/ring.hpp"
#include "hal/serial.hpp"

namespace fxdyn::hal::mps2 {

/// UART0. Received bytes go through a ring buffer that the interrupt fills (the device has no FIFO); sending polls.
/// Registers: Cortex-M System Design Kit Technical Reference Manual (DDI 0479), "APB UART", programmers model.
/// One instance, whose on_receive() the interrupt handler calls.
template <Registers R = MemoryMapped>
class BasicUart {
 public:
  explicit constexpr BasicUart(R registers = {}) : registers_(registers) {}

  void start() {
    registers_.write(baud_divider, clock_hz / baud_rate);
    registers_.write(control, transmit_enable | receive_enable | receive_interrupt_enable);
    cortex_m::enable_interrupt(registers_, uart0_receive_interrupt);
  }

  std::size_t read(std::span<std::uint8_t> bytes) { return ring_.pop(bytes); }

  std::size_t write(std::span<const std::uint8_t> bytes) {
    std::size_t count = 0;
    while (count < bytes.size() && (registers_.read(state) & transmit_full) == 0)
      registers_.write(data, bytes[count++]);
    return count;
  }

  /// Sleeps until a byte or another interrupt has arrived. WFI also wakes on a masked interrupt, so none is missed
  /// between test and sleep.
  void wait() {
    cortex_m::mask_interrupts();
    if (ring_.empty()) cortex_m::wait_for_interrupt();
    cortex_m::unmask_interrupts();
  }

  /// Sleeps until a carriage return or another interrupt than this one's has arrived: a processor that is woken
  /// for the bytes in between has nothing to do with them. Bytes without an end in sight wait for the other interrupt.
  void wait_for_line() {
    for (;;) {
      const std::uint32_t seen = received_.load(std::memory_order_relaxed);
      cortex_m::mask_interrupts();
      if (!line_ended_.load(std::memory_order_relaxed)) cortex_m::wait_for_interrupt();
      cortex_m::unmask_interrupts();
      if (line_ended_.exchange(false) || received_.load(std::memory_order_relaxed) == seen) return;
    }
  }

  /// The interrupt is cleared before the data is read: a byte that arrives in between raises it again.
  void on_receive() {
    registers_.write(interrupt_status, receive_interrupt);
    // A full ring drops the byte; the frame that it belongs to is then damaged, which its reader notices.
    if ((registers_.read(state) & receive_full) == 0) return;
    const auto byte = static_cast<std::uint8_t>(registers_.read(data));
    ring_.push(byte);
    received_.store(received_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
    if (byte == line_end) line_ended_.store(true, std::memory_order_relaxed);
  }

 private:
  static constexpr Address data = uart0_address + 0x00;              // DATA
  static constexpr Address state = uart0_address + 0x04;             // STATE
  static constexpr Address control = uart0_address + 0x08;           // CTRL
  static constexpr Address interrupt_status = uart0_address + 0x0c;  // INTSTATUS, write 1 to clear
  static constexpr Address baud_divider = uart0_address + 0x10;      // BAUDDIV, at least 16
  static constexpr std::uint32_t transmit_full = 1U << 0, receive_full = 1U << 1;
  static constexpr std::uint32_t transmit_enable = 1U << 0, receive_enable = 1U << 1,
                                 receive_interrupt_enable = 1U << 3;
  static constexpr std::uint32_t receive_interrupt = 1U << 1;
  static constexpr std::uint8_t line_end = '\r';
  static constexpr std::uint32_t baud_rate = 921'600;

  [[no_unique_address]] R registers_;
  Ring<std::uint8_t, 1024> ring_;
  std::atomic<std::uint32_t> received_{0};  // both written by the interrupt
  std::atomic<bool> line_ended_{false};
};
using Uart = BasicUart<>;
static_assert(SerialPort<Uart>);

}  // namespace fxdyn::hal::mps2
