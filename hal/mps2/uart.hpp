#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/mps2/board.hpp"
#include "hal/serial.hpp"

namespace fxdyn::hal::mps2 {

/// UART0. Received bytes go through a ring buffer that the interrupt fills (the device has no FIFO); sending polls.
/// Registers: Cortex-M System Design Kit Technical Reference Manual (DDI 0479), "APB UART", programmers model.
/// One instance, whose on_receive() the interrupt handler calls.
class Uart {
 public:
  constexpr Uart() = default;

  void start() {
    reg(baud_divider) = clock_hz / baud_rate;
    reg(control) = transmit_enable | receive_enable | receive_interrupt_enable;
    // NVIC_ISERn, Armv7-M Architecture Reference Manual, B3.4
    reg(0xe000'e100 + 4 * (uart0_receive_interrupt / 32)) = 1U << (uart0_receive_interrupt % 32);
  }

  std::size_t read(std::span<std::uint8_t> bytes) {
    std::size_t count = 0;
    std::uint32_t tail = tail_.load(std::memory_order_relaxed);
    const std::uint32_t head = head_.load(std::memory_order_acquire);
    while (count < bytes.size() && tail != head) bytes[count++] = ring_[tail++ % size];
    tail_.store(tail, std::memory_order_release);
    return count;
  }

  std::size_t write(std::span<const std::uint8_t> bytes) {
    std::size_t count = 0;
    while (count < bytes.size() && (reg(state) & transmit_full) == 0) reg(data) = bytes[count++];
    return count;
  }

  /// Sleeps until a byte has arrived. WFI also wakes on a masked interrupt, so none is missed between test and sleep.
  void wait() {
    mask_interrupts();
    if (head_.load(std::memory_order_relaxed) == tail_.load(std::memory_order_relaxed)) {
      asm volatile("dsb\n wfi" ::: "memory");
    }
    unmask_interrupts();
  }

  /// The interrupt is cleared before the data is read: a byte that arrives in between raises it again.
  void on_receive() {
    reg(interrupt_status) = receive_interrupt;
    std::uint32_t head = head_.load(std::memory_order_relaxed);
    if ((reg(state) & receive_full) != 0) {
      const auto byte = static_cast<std::uint8_t>(reg(data));
      // A full ring drops the byte; the frame's checksum tells.
      if (head - tail_.load(std::memory_order_acquire) < size) ring_[head++ % size] = byte;
    }
    head_.store(head, std::memory_order_release);
  }

 private:
  static constexpr std::uintptr_t data = uart0_address + 0x00;              // DATA
  static constexpr std::uintptr_t state = uart0_address + 0x04;             // STATE
  static constexpr std::uintptr_t control = uart0_address + 0x08;           // CTRL
  static constexpr std::uintptr_t interrupt_status = uart0_address + 0x0c;  // INTSTATUS, write 1 to clear
  static constexpr std::uintptr_t baud_divider = uart0_address + 0x10;      // BAUDDIV, at least 16
  static constexpr std::uint32_t transmit_full = 1U << 0, receive_full = 1U << 1;
  static constexpr std::uint32_t transmit_enable = 1U << 0, receive_enable = 1U << 1,
                                 receive_interrupt_enable = 1U << 3;
  static constexpr std::uint32_t receive_interrupt = 1U << 1;
  static constexpr std::uint32_t baud_rate = 921'600;
  static constexpr std::uint32_t size = 1024;  // a power of two: the indices run freely and wrap

  std::array<std::uint8_t, size> ring_{};
  std::atomic<std::uint32_t> head_{0};  // written by the interrupt
  std::atomic<std::uint32_t> tail_{0};  // written by read()
};
static_assert(SerialPort<Uart>);

}  // namespace fxdyn::hal::mps2
