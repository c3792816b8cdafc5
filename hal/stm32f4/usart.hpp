#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/cortex_m/core.hpp"
#include "hal/ring.hpp"
#include "hal/serial.hpp"
#include "hal/stm32/clock.hpp"
#include "hal/stm32f4/board.hpp"

namespace fxdyn::hal::stm32f4 {

/// USART1 (RM0090, "Universal synchronous asynchronous receiver transmitter (USART)"), 8 bits, no parity. Received
/// bytes go through a ring that the interrupt fills; sending polls. One instance, whose on_receive() the interrupt
/// handler calls.
template <Registers R = MemoryMapped>
class BasicUsart {
 public:
  explicit constexpr BasicUsart(R registers = {}) : registers_(registers) {}

  void start(stm32::SystemClock clock) {
    // BRR is clock / baud rate in sixteenths; APB2 has 84 or 16 MHz.
    registers_.write(baud_rate, clock.mhz == 168 ? divider(84'000'000) : divider(16'000'000));
    registers_.write(control, enable | transmit_enable | receive_enable | receive_interrupt_enable);
    cortex_m::enable_interrupt(registers_, usart1_interrupt);
  }
  std::size_t read(std::span<std::uint8_t> bytes) { return ring_.pop(bytes); }
  std::size_t write(std::span<const std::uint8_t> bytes) {
    std::size_t count = 0;
    while (count < bytes.size() && (registers_.read(status) & transmit_empty) != 0)
      registers_.write(data, bytes[count++]);
    return count;
  }
  /// Reading SR, then DR clears RXNE and an overrun alike. A full ring drops the byte; its frame's reader notices.
  void on_receive() {
    if ((registers_.read(status) & (receive_not_empty | overrun)) != 0)
      ring_.push(static_cast<std::uint8_t>(registers_.read(data)));
  }

 private:
  static consteval std::uint32_t divider(std::uint32_t clock_hz) {
    constexpr std::uint32_t bits_per_second = 921'600;
    return (clock_hz + bits_per_second / 2) / bits_per_second;
  }
  static constexpr Address status = usart1 + 0x00, data = usart1 + 0x04, baud_rate = usart1 + 0x08,
                           control = usart1 + 0x0c;
  static constexpr std::uint32_t overrun = 1U << 3, receive_not_empty = 1U << 5, transmit_empty = 1U << 7;  // SR
  static constexpr std::uint32_t receive_enable = 1U << 2, transmit_enable = 1U << 3,
                                 receive_interrupt_enable = 1U << 5, enable = 1U << 13;  // CR1
  [[no_unique_address]] R registers_;
  Ring<std::uint8_t, 1024> ring_;
};
using Usart = BasicUsart<>;
static_assert(SerialPort<Usart>);

}  // namespace fxdyn::hal::stm32f4
