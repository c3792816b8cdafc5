#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "hal/can.hpp"
#include "hal/can_timing.hpp"
#include "hal/cortex_m/core.hpp"
#include "hal/ring.hpp"
#include "hal/stm32g4/board.hpp"

namespace fxdyn::hal::stm32g4 {

struct FdcanTiming {
  BitTiming nominal, data;
};

/// FDCAN_NBTP and FDCAN_DBTP (RM0440): what their fields hold.
inline constexpr BitTimingLimits nominal_limits{512, 2, 256, 2, 128, 128};
inline constexpr BitTimingLimits data_limits{32, 1, 32, 1, 16, 16};

/// Both bit rates from `clock_hz`; impossible ones don't compile. Data phase: sample point 75 % (CiA 601-3 for
/// 2 Mbit/s).
consteval FdcanTiming fdcan_timing(std::uint32_t clock_hz, std::uint32_t bit_rate, std::uint32_t data_bit_rate,
                                   std::uint32_t fewest_data_quanta = BitRate{}.fewest_quanta) {
  return {bit_timing(nominal_limits, clock_hz, {.bits_per_second = bit_rate}),
          bit_timing(data_limits, clock_hz,
                     {.bits_per_second = data_bit_rate, .sample_permille = 750, .fewest_quanta = fewest_data_quanta})};
}

/// FDCAN1 (RM0440, "FD controller area network (FDCAN)"), classic and FD frames with the bit rate switched. The
/// message RAM has a fixed layout: per instance 28 standard filters, 8 extended ones, twice 3 received frames, 3
/// transmit events, 3 frames to send. Three received frames are 0.35 ms at 1 Mbit/s, so the interrupt moves them to a
/// ring; the other FIFO stays empty, since the order between setpoints and SYNC counts. Everything is let through until
/// listen(). What waits to be sent is a queue: the lowest identifier goes first, so that no heartbeat that lost the
/// arbitration keeps a torque waiting. One instance, whose on_receive() the interrupt handler calls.
template <Registers R = MemoryMapped>
class BasicFdcan {
 public:
  using Frame = FdFrame;

  explicit constexpr BasicFdcan(R registers = {}) : registers_(registers) {}

  /// Takes part in the bus from here on. failed: the controller does not answer; is its clock on?
  Status start(FdcanTiming timing) {
    clear_bits(registers_, control, clock_stop);
    set_bits(registers_, control, init);
    if (!wait_for(registers_, control, init, tries)) return Status::failed;
    set_bits(registers_, control, change_enable);
    registers_.write(clock_divider, 0);
    set_bits(registers_, control, fd_enable | bit_rate_switch);
    const BitTiming &n = timing.nominal, &d = timing.data;
    registers_.write(nominal_timing,
                     (n.jump_width - 1) << 25 | (n.prescaler - 1) << 16 | (n.segment1 - 1) << 8 | (n.segment2 - 1));
    // The transmitter's delay can be compensated with a prescaler of 1 or 2 only; it has to be where the transceiver's
    // loop delay (255 ns at most, ISO 11898-2) comes near the data bit's sample point.
    const bool compensate = d.prescaler <= 2;
    registers_.write(data_timing, (compensate ? 1U << 23 : 0) | (d.prescaler - 1) << 16 | (d.segment1 - 1) << 8 |
                                      (d.segment2 - 1) << 4 | (d.jump_width - 1));
    registers_.write(delay_compensation, std::min<std::uint32_t>(d.prescaler * (1 + d.segment1), 0x7fU)
                                             << 8);  // to the sample point
    // All filter elements of both kinds; what matches none is rejected. FIFO 0 blocks when full.
    registers_.write(filters, extended_filters << 24 | standard_filters << 16 | 0b10U << 4 | 0b10U << 2);
    registers_.write(transmit_buffers, queue_mode);
    for (Address word = 0; word < message_ram_bytes; word += 4) registers_.write(ram + word, 0);
    registers_.write(ram, accept(0, 0x7ff));
    registers_.write(ram + extended_offset, 1U << 29);         // EFEC: to FIFO 0, from identifier 0 ..
    registers_.write(ram + extended_offset + 4, 0x1fff'ffff);  // .. EFT: a range, to the last one
    registers_.write(interrupts, all_interrupts);              // none from before
    registers_.write(interrupt_enable, new_in_fifo0 | lost_in_fifo0);
    registers_.write(interrupt_lines, 1);   // line 0
    clear_bits(registers_, control, init);  // and with it CCE
    cortex_m::enable_interrupt(registers_, fdcan1_interrupt);
    return wait_for(registers_, control, init, tries, true) ? Status::ok : Status::failed;
  }

  /// Only these come through, of frames with 29 bits none; everything with 11 bits where the elements don't suffice.
  /// The message RAM takes filters while the controller runs.
  void listen(std::span<const IdRange> ranges) {
    registers_.write(ram + extended_offset, 0);
    const bool fit = ranges.size() <= standard_filters;
    for (std::size_t i = 0; i < standard_filters; ++i) {
      const std::uint32_t element = !fit                ? (i == 0 ? accept(0, 0x7ff) : 0)
                                    : i < ranges.size() ? accept(ranges[i].first, ranges[i].last)
                                                        : 0;
      registers_.write(ram + 4 * static_cast<Address>(i), element);
    }
  }

  /// busy also while a frame with this identifier waits: in a queue the order of two of them is anyone's guess (RM0440,
  /// "Tx queue"), and so no identifier takes more than one of the three places.
  Status send(const Frame& frame) {
    if (off_bus()) return Status::failed;
    const int code = length_code(frame);
    if (code < 0) return Status::failed;
    const std::uint32_t queue = registers_.read(transmit_status);
    if ((queue & 1U << 21) != 0) return Status::busy;  // TFQF
    const std::uint32_t head = (frame.extended ? 1U << 30 | frame.id : frame.id << 18) | (frame.remote ? 1U << 29 : 0);
    if (is_waiting(head)) return Status::busy;
    const std::uint32_t index = queue >> 16 & 0b11;  // TFQPI: the first free one
    const Address element = ram + transmit_offset + index * element_bytes;
    registers_.write(element, head);
    registers_.write(element + 4, (frame.fd ? 0b11U << 20 : 0) | static_cast<std::uint32_t>(code) << 16);  // FDF, BRS
    for (std::uint32_t at = 0; !frame.remote && at < frame.size; at += 4) {
      std::uint32_t word = 0;  // the message RAM takes whole words only
      for (std::uint32_t i = 0; i < 4 && at + i < frame.size; ++i)
        word |= static_cast<std::uint32_t>(frame.data[at + i]) << 8 * i;
      registers_.write(element + 8 + at, word);
    }
    heads_[index] = head;
    registers_.write(transmit_request, 1U << index);
    return Status::ok;
  }

  bool has_sent_all() { return registers_.read(transmit_pending) == 0; }

  Status receive(Frame& frame) {
    if (received_.pop(frame)) return Status::ok;
    return off_bus() ? Status::failed : Status::busy;
  }

  CanErrors errors() {
    const std::uint32_t state = registers_.read(protocol_status), counters = registers_.read(error_counters);
    return {(state & bus_off) != 0   ? CanState::bus_off
            : (state & passive) != 0 ? CanState::passive
                                     : CanState::active,
            static_cast<std::uint8_t>(counters), static_cast<std::uint8_t>(counters >> 8 & 0x7f),
            lost_.load(std::memory_order_relaxed)};
  }

  /// Bus-off sets INIT; once that is cleared the controller waits for the 128 times 11 recessive bits by itself
  /// (RM0440, "Bus_Off recovery"). What was waiting to be sent is too old by then.
  Status restart() {
    if ((registers_.read(control) & init) != 0) {
      registers_.write(transmit_cancel, all_places);
      clear_bits(registers_, control, init);
    }
    return off_bus() ? Status::busy : Status::ok;
  }

  /// Sleeps until a frame or another interrupt has come. WFI also wakes on a masked one.
  void wait() {
    cortex_m::mask_interrupts();
    if (received_.empty()) cortex_m::wait_for_interrupt();
    cortex_m::unmask_interrupts();
  }

  void on_receive() {
    const std::uint32_t raised = registers_.read(interrupts);
    registers_.write(interrupts, raised);  // before the FIFO is emptied: what comes meanwhile raises it again
    if ((raised & lost_in_fifo0) != 0) count_lost();
    Frame frame;
    for (std::uint32_t fifo; ((fifo = registers_.read(receive_status)) & 0xf) != 0;) {  // F0FL
      const std::uint32_t index = fifo >> 8 & 0b11;                                     // F0GI
      const Address element = ram + receive_offset + index * element_bytes;
      const std::uint32_t head = registers_.read(element), shape = registers_.read(element + 4);
      frame.extended = (head & 1U << 30) != 0;
      frame.remote = (head & 1U << 29) != 0;
      frame.id = frame.extended ? head & 0x1fff'ffff : head >> 18 & 0x7ff;
      frame.fd = (shape & 1U << 21) != 0;
      const std::uint32_t code = shape >> 16 & 0xf;
      frame.size = frame.fd ? lengths[code] : static_cast<std::uint8_t>(std::min<std::uint32_t>(code, 8));
      frame.data = {};
      for (std::uint32_t at = 0; !frame.remote && at < frame.size; at += 4) {
        const std::uint32_t word = registers_.read(element + 8 + at);
        for (std::uint32_t i = 0; i < 4; ++i) frame.data[at + i] = static_cast<std::uint8_t>(word >> 8 * i);
      }
      registers_.write(receive_acknowledge, index);
      if (!received_.push(frame)) count_lost();
    }
  }

 private:
  static constexpr std::array<std::uint8_t, 16> lengths{0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

  /// DLC (ISO 11898-1); -1 where no frame has that length.
  static int length_code(const Frame& frame) {
    if (frame.fd && frame.remote) return -1;
    for (int code = 0; code < (frame.fd ? 16 : 9); ++code)
      if (lengths[static_cast<std::size_t>(code)] == frame.size) return code;
    return -1;
  }

  bool is_waiting(std::uint32_t head) {
    const std::uint32_t pending = registers_.read(transmit_pending);
    for (std::uint32_t i = 0; i < heads_.size(); ++i)
      if ((pending >> i & 1U) != 0 && heads_[i] == head) return true;
    return false;
  }

  /// Standard filter element: SFT = 0, a range; SFEC = 1, to FIFO 0.
  static constexpr std::uint32_t accept(std::uint32_t first, std::uint32_t last) {
    return 1U << 27 | first << 16 | last;
  }

  bool off_bus() { return (registers_.read(control) & init) != 0 || (registers_.read(protocol_status) & bus_off) != 0; }
  void count_lost() { lost_.store(lost_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed); }

  static constexpr Address data_timing = fdcan1 + 0x0c, control = fdcan1 + 0x18, nominal_timing = fdcan1 + 0x1c,
                           error_counters = fdcan1 + 0x40, protocol_status = fdcan1 + 0x44,
                           delay_compensation = fdcan1 + 0x48, interrupts = fdcan1 + 0x50,
                           interrupt_enable = fdcan1 + 0x54, interrupt_lines = fdcan1 + 0x5c, filters = fdcan1 + 0x80,
                           receive_status = fdcan1 + 0x90, receive_acknowledge = fdcan1 + 0x94,
                           transmit_buffers = fdcan1 + 0xc0, transmit_status = fdcan1 + 0xc4,
                           transmit_pending = fdcan1 + 0xc8, transmit_request = fdcan1 + 0xcc,
                           transmit_cancel = fdcan1 + 0xd0, clock_divider = fdcan1 + 0x100;
  // CCCR
  static constexpr std::uint32_t init = 1U << 0, change_enable = 1U << 1, clock_stop = 1U << 4, fd_enable = 1U << 8,
                                 bit_rate_switch = 1U << 9;
  static constexpr std::uint32_t new_in_fifo0 = 1U << 0, lost_in_fifo0 = 1U << 2, all_interrupts = 0x00ff'ffff;  // IR
  static constexpr std::uint32_t passive = 1U << 5, bus_off = 1U << 7;                                           // PSR
  static constexpr std::uint32_t queue_mode = 1U << 24;  // TXBC: TFQM
  static constexpr std::uint32_t all_places = 0b111;     // TXBCR
  // Message RAM (RM0440, figure "Message RAM configuration")
  static constexpr Address ram = fdcan1_message_ram;
  static constexpr std::uint32_t element_bytes = 72, extended_offset = 0x70, receive_offset = 0xb0,
                                 transmit_offset = 0x278, message_ram_bytes = 0x350;
  static constexpr std::uint32_t standard_filters = 28, extended_filters = 8;
  static constexpr std::uint32_t tries = 100'000;

  [[no_unique_address]] R registers_;
  std::array<std::uint32_t, 3> heads_{};  ///< identifiers of the places to send from
  Ring<Frame, 16> received_;
  std::atomic<std::uint32_t> lost_{0};  // written by the interrupt
};
using Fdcan = BasicFdcan<>;
static_assert(FilteringCanBus<Fdcan> && SortingCanBus<Fdcan>);

}  // namespace fxdyn::hal::stm32g4
