#pragma once

#include <cstdint>

#include "hal/can.hpp"
#include "hal/can_timing.hpp"
#include "hal/clock.hpp"
#include "hal/zynqmp_r5/board.hpp"
#include "hal/zynqmp_r5/clock.hpp"

namespace fxdyn::hal::zynqmp_r5 {

/// Bit timing fields BRPR, BTR (UG1087, module CAN): TS1, TS2, SJW.
inline constexpr BitTimingLimits can_limits{256, 1, 16, 1, 8, 4};

/// How a frame stands in the FIFOs' words.
enum class FrameFormat {
  controller,  ///< as UG1085 has it: identifier from bit 31 down, first data byte in bits 31..24
  qemu_7,      ///< as QEMU's model up to 7.2 has it: Linux' can_id, first data byte in bits 7..0
};

/// CAN controller 0 of the Zynq UltraScale+ (UG1085, chapter "CAN Controller"): FIFOs of 64 frames in both directions,
/// polled. CAN FD it has not.
template <FrameFormat format, Clock C, Registers R = MemoryMapped>
class BasicXcan {
 public:
  using Frame = ClassicFrame;

  explicit constexpr BasicXcan(C& clock, R registers = {}) : clock_(clock), registers_(registers) {}

  /// failed: the controller does not leave configuration mode.
  Status start(BitTiming timing, std::uint32_t bit_rate_kilo) {
    timing_ = timing;
    // 128 times 11 bits in microseconds, without a division: at least 1408 us at 1 Mbit/s.
    recovery_us_ = 0;
    for (std::uint32_t bits = 0; bits < 128 * 11 * 1000; bits += bit_rate_kilo) ++recovery_us_;
    return enter_bus();
  }

  Status send(const Frame& frame) {
    if (frame.fd || frame.size > 8 || waiting_) return Status::failed;
    const std::uint32_t now = registers_.read(status);
    if (state_of(now) == CanState::bus_off) return Status::failed;
    if ((now & transmit_full) != 0) return Status::busy;
    registers_.write(transmit_fifo + 0x0, identifier(frame));
    registers_.write(transmit_fifo + 0x4, static_cast<std::uint32_t>(frame.size) << 28);
    registers_.write(transmit_fifo + 0x8, word(frame, 0));
    registers_.write(transmit_fifo + 0xc, word(frame, 4));  // the last of the four words hands the frame over
    return Status::ok;
  }

  Status receive(Frame& frame) {
    const std::uint32_t raised = registers_.read(interrupts);
    if ((raised & receive_overflow) != 0) {
      ++lost_;
      registers_.write(interrupt_clear, receive_overflow);
    }
    if ((raised & receive_not_empty) == 0) return waiting_ ? Status::failed : Status::busy;
    const std::uint32_t head = registers_.read(receive_fifo + 0x0), shape = registers_.read(receive_fifo + 0x4),
                        first = registers_.read(receive_fifo + 0x8), second = registers_.read(receive_fifo + 0xc);
    registers_.write(interrupt_clear, receive_not_empty);  // comes back at once where the FIFO has more
    read_identifier(head, frame);
    const std::uint32_t length = shape >> 28;
    frame.fd = false;
    frame.size = static_cast<std::uint8_t>(length < 8 ? length : 8);
    for (int i = 0; i < 8; ++i) {
      const std::uint32_t data = i < 4 ? first : second;
      const bool valid = i < frame.size && !frame.remote;
      frame.data[static_cast<std::size_t>(i)] = valid ? static_cast<std::uint8_t>(data >> shift(i % 4)) : 0;
    }
    return Status::ok;
  }

  CanErrors errors() {
    const std::uint32_t counters = registers_.read(error_counters);
    return {state(), static_cast<std::uint8_t>(counters), static_cast<std::uint8_t>(counters >> 8), lost_};
  }

  /// The controller leaves bus-off through its reset, which forgets the error counters: the time that ISO 11898-1 asks
  /// for at least, 128 times 11 recessive bits, passes in configuration mode, off the bus. Frames that wait to be sent
  /// are gone with the reset.
  Status restart() {
    if (!waiting_) {
      if (state() != CanState::bus_off) return Status::ok;
      registers_.write(reset, soft_reset);
      waiting_ = true;
      since_us_ = clock_.now_us();
      return Status::busy;
    }
    if (clock_.now_us() - since_us_ < recovery_us_) return Status::busy;
    waiting_ = false;
    return enter_bus();
  }

 private:
  Status enter_bus() {
    registers_.write(reset, soft_reset);
    if (!wait_for(registers_, status, configuration_mode, tries)) return Status::failed;
    registers_.write(prescaler, timing_.prescaler - 1);
    registers_.write(bit_timing_register,
                     (timing_.jump_width - 1) << 7 | (timing_.segment2 - 1) << 4 | (timing_.segment1 - 1));
    registers_.write(mode, 0);               // normal
    registers_.write(interrupt_enable, 0);   // ISR latches all the same, and is polled
    registers_.write(acceptance_filter, 0);  // none: every frame is stored
    registers_.write(reset, can_enable);
    return wait_for(registers_, status, normal_mode, tries) ? Status::ok : Status::failed;
  }

  CanState state() { return waiting_ ? CanState::bus_off : state_of(registers_.read(status)); }
  static CanState state_of(std::uint32_t status_register) {
    switch (status_register >> 7 & 0b11) {  // ESTAT
      case 0b10:
        return CanState::bus_off;
      case 0b11:
        return CanState::passive;
      default:
        return CanState::active;
    }
  }

  static std::uint32_t identifier(const Frame& frame) {
    const std::uint32_t remote = frame.remote ? 1 : 0;
    if constexpr (format == FrameFormat::qemu_7) return frame.id | (frame.extended ? 1U << 31 : 0) | remote << 30;
    if (!frame.extended) return frame.id << 21 | remote << 20;
    return (frame.id >> 18) << 21 | 0b11U << 19 | (frame.id & 0x3'ffff) << 1 | remote;  // IDH, SRR and IDE, IDL, RTR
  }
  static void read_identifier(std::uint32_t head, Frame& frame) {
    if constexpr (format == FrameFormat::qemu_7) {
      frame.extended = (head & 1U << 31) != 0;
      frame.remote = (head & 1U << 30) != 0;
      frame.id = head & (frame.extended ? 0x1fff'ffff : 0x7ff);
    } else {
      frame.extended = (head & 1U << 19) != 0;
      frame.remote = (head & (frame.extended ? 1U << 0 : 1U << 20)) != 0;
      frame.id = frame.extended ? (head >> 21) << 18 | (head >> 1 & 0x3'ffff) : head >> 21;
    }
  }
  /// Where byte 0..3 stands in its word.
  static constexpr int shift(int byte) { return format == FrameFormat::qemu_7 ? 8 * byte : 24 - 8 * byte; }
  static std::uint32_t word(const Frame& frame, std::size_t from) {
    std::uint32_t value = 0;
    for (int i = 0; i < 4; ++i) {
      const std::size_t at = from + static_cast<std::size_t>(i);
      if (at < frame.size && !frame.remote) value |= static_cast<std::uint32_t>(frame.data[at]) << shift(i);
    }
    return value;
  }

  static constexpr Address reset = can0 + 0x00, mode = can0 + 0x04, prescaler = can0 + 0x08,
                           bit_timing_register = can0 + 0x0c, error_counters = can0 + 0x10, status = can0 + 0x18,
                           interrupts = can0 + 0x1c, interrupt_enable = can0 + 0x20, interrupt_clear = can0 + 0x24,
                           transmit_fifo = can0 + 0x30, receive_fifo = can0 + 0x50, acceptance_filter = can0 + 0x60;
  static constexpr std::uint32_t soft_reset = 1U << 0, can_enable = 1U << 1;                                     // SRR
  static constexpr std::uint32_t configuration_mode = 1U << 0, normal_mode = 1U << 3, transmit_full = 1U << 10;  // SR
  static constexpr std::uint32_t receive_overflow = 1U << 6, receive_not_empty = 1U << 7;                        // ISR
  static constexpr std::uint32_t tries = 100'000;

  C& clock_;
  [[no_unique_address]] R registers_;
  BitTiming timing_{};
  std::uint32_t recovery_us_ = 0, since_us_ = 0, lost_ = 0;
  bool waiting_ = false;  ///< off the bus until the recovery time is over
};
static_assert(CanBus<BasicXcan<FrameFormat::controller, MicrosecondClock>>);
static_assert(CanBus<BasicXcan<FrameFormat::qemu_7, MicrosecondClock>>);

}  // namespace fxdyn::hal::zynqmp_r5
