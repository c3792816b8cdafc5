#pragma once

#include <array>
#include <bit>
#include <optional>

#include "hal/can.hpp"
#include "tests/hal/models/register_model.hpp"

namespace fxdyn::test {

/// FDCAN of the STM32G4, RM0440 "FD controller area network": FDCAN1 at 0x40006400 with its message RAM at 0x4000A400.
class FdcanModel : public RegisterModel {
 public:
  static constexpr hal::Address base = 0x4000'6400, ram = 0x4000'a400;
  bool clocked = true;  ///< false: reads as zero, takes nothing

  bool initialising() const { return (cccr_ & 1U) != 0; }
  bool fd_enabled() const { return (cccr_ & 0x300U) == 0x300; }
  std::uint32_t field(hal::Address offset, int from, int bits) {
    return registers_[base + offset] >> from & ((1U << bits) - 1);
  }

  std::uint32_t bit_rate(std::uint32_t clock_hz) {  // NBTP
    return clock_hz / ((field(0x1c, 16, 9) + 1) * (1 + field(0x1c, 8, 8) + 1 + field(0x1c, 0, 7) + 1));
  }
  std::uint32_t data_bit_rate(std::uint32_t clock_hz) {  // DBTP
    return clock_hz / ((field(0x0c, 16, 5) + 1) * (1 + field(0x0c, 8, 5) + 1 + field(0x0c, 4, 4) + 1));
  }

  /// A frame comes in from the bus. Blocking mode: a full FIFO drops it.
  void arrives(const hal::FdFrame& frame, std::uint32_t code) {
    if (initialising() || !accepts(frame)) return;
    if (level_ == 3) {
      interrupts_ |= 1U << 2;  // RF0L
      return;
    }
    const std::uint32_t put = (get_ + level_) % 3;
    const hal::Address element = ram + 0xb0 + 72 * put;
    memory_[element] = (frame.extended ? 1U << 30 | frame.id : frame.id << 18) | (frame.remote ? 1U << 29 : 0);
    memory_[element + 4] = (frame.fd ? 3U << 20 : 0) | code << 16 | 0x1234;  // with a time stamp
    for (std::uint32_t at = 0; at < frame.size; at += 4) {
      std::uint32_t word = 0;
      for (std::uint32_t i = 0; i < 4; ++i) word |= std::uint32_t{frame.data[at + i]} << 8 * i;
      memory_[element + 8 + at] = word;
    }
    ++level_;
    interrupts_ |= 1U;  // RF0N
  }
  bool interrupt() { return (interrupts_ & registers_[base + 0x54]) != 0 && (registers_[base + 0x5c] & 1U) != 0; }

  struct Sent {
    std::uint32_t head, shape;
    std::array<std::uint32_t, 16> words;
  };
  /// The frame that wins the arbitration goes out onto the bus.
  std::optional<Sent> transmit() {
    if (pending_ == 0 || initialising() || off_) return {};
    std::uint32_t first = 0;
    for (std::uint32_t index = 0; index < 3; ++index) {
      if ((pending_ >> index & 1U) == 0) continue;
      if ((pending_ >> first & 1U) == 0 || on_the_bus(head(index)) < on_the_bus(head(first))) first = index;
    }
    pending_ &= ~(1U << first);
    const hal::Address element = ram + 0x278 + 72 * first;
    Sent sent{memory_[element], memory_[element + 4], {}};
    for (std::uint32_t i = 0; i < 16; ++i) sent.words[i] = memory_[element + 8 + 4 * i];
    return sent;
  }
  int waiting() const { return std::popcount(pending_); }

  void set_counters(std::uint32_t transmit, std::uint32_t receive) {
    registers_[base + 0x40] = transmit | receive << 8;
    passive_ = transmit > 127 || receive > 127;
  }
  void go_off_the_bus() {
    off_ = true;
    cccr_ |= 1;
    sequences_ = 0;
  }
  /// 11 recessive bits in a row, so many times. They count once INIT has been cleared.
  void idle_sequences(int count) {
    if (initialising() || !off_) return;
    sequences_ += count;
    if (sequences_ >= 129) {
      off_ = false;
      set_counters(0, 0);
    }
  }

 protected:
  std::uint32_t on_read(hal::Address address) override {
    if (!clocked) return 0;
    if (in_ram(address)) {
      if (address >= ram + 0xb0 && address < ram + 0x188)
        require(level_ > 0 && (address - ram - 0xb0) / 72 == get_, "reads another element than the get index");
      return memory_[address];
    }
    switch (address - base) {
      case 0x18:
        return cccr_;
      case 0x44:
        return 7U | (passive_ ? 1U << 5 : 0) | (off_ ? 1U << 7 : 0);
      case 0x50:
        return interrupts_;
      case 0x90:
        return level_ | get_ << 8 | (get_ + level_) % 3 << 16 | (level_ == 3 ? 1U << 24 : 0);
      case 0xc4:
        return pending_ == 0b111 ? 1U << 21 : put() << 16;  // of a queue TFGI and TFFL are zero
      case 0xc8:
        return pending_;
      default:
        return registers_[address];
    }
  }
  void on_write(hal::Address address, std::uint32_t value) override {
    if (!clocked) return;
    if (in_ram(address)) {
      require(address % 4 == 0, "message RAM is written in words");
      if (address >= ram + 0x278 && !initialising())
        require(pending_ != 0b111 && (address - ram - 0x278) / 72 == put(), "writes an element that may be in use");
      memory_[address] = value;
      return;
    }
    const bool open = (cccr_ & 0b11) == 0b11;
    switch (address - base) {
      case 0x18: {
        const std::uint32_t protected_bits = 0b1011'0011'1110'0000U;
        require((cccr_ & 1U) != 0 || (value & 0b10) == 0, "CCE needs INIT");
        require(open || ((value ^ cccr_) & protected_bits) == 0, "CCCR: protected bits need CCE");
        if ((value & 1U) == 0) value &= ~0b10U;
        cccr_ = value;
        return;
      }
      case 0x0c:
      case 0x1c:
      case 0x48:
      case 0x80:
      case 0xc0:
      case 0x100:
        if (address == base + 0xc0) require(value == 1U << 24, "TXBC: this model knows the queue alone (TFQM)");
        require(open, "configuration needs INIT and CCE");
        if (open) registers_[address] = value;
        return;
      case 0x40:
      case 0x44:
      case 0x90:
      case 0xc4:
      case 0xc8:
        require(false, "writes a register that only reads");
        return;
      case 0x50:
        interrupts_ &= ~value;
        return;
      case 0x94:
        require(level_ > 0 && value == get_, "acknowledges another element than the oldest");
        get_ = (get_ + 1) % 3;
        level_ -= level_ > 0 ? 1 : 0;
        return;
      case 0xcc:
        require(!initialising() && !off_, "asks to send while off the bus");
        require(pending_ != 0b111 && value == 1U << put(), "asks to send another element than the put index");
        for (std::uint32_t i = 0; i < 3; ++i)
          require((pending_ >> i & 1U) == 0 || head(i) != head(put()), "an identifier twice: their order is not known");
        pending_ |= value;
        return;
      case 0xd0:
        pending_ &= ~value;
        return;
      case 0x54:
      case 0x58:
      case 0x5c:
        registers_[address] = value;
        return;
      default:
        require(false, "writes offset " + std::to_string(address - base));
    }
  }

 private:
  /// Filter elements in their order, then what RXGFC says of frames that match none.
  bool accepts(const hal::FdFrame& frame) {
    const std::uint32_t global = registers_[base + 0x80];
    require((global >> 16 & 0x1f) <= 28 && (global >> 24 & 0xf) <= 8, "more filter elements than there are");
    if (frame.remote && (global >> (frame.extended ? 0 : 1) & 1U) != 0) return false;  // RRFE, RRFS
    if (frame.extended) {
      for (hal::Address i = 0; i < (global >> 24 & 0xf); ++i) {
        const std::uint32_t first = memory_[ram + 0x70 + 8 * i], second = memory_[ram + 0x74 + 8 * i];
        if (first >> 29 == 0) continue;
        require(first >> 29 == 1 && second >> 30 == 0, "an element that this model does not know");
        if (frame.id >= (first & 0x1fff'ffff) && frame.id <= (second & 0x1fff'ffff)) return true;
      }
      return (global >> 2 & 0b11) == 0;
    }
    for (hal::Address i = 0; i < (global >> 16 & 0x1f); ++i) {
      const std::uint32_t element = memory_[ram + 4 * i];
      if ((element >> 27 & 0b111) == 0) continue;
      require((element >> 27 & 0b111) == 1 && element >> 30 == 0, "an element that this model does not know");
      if (frame.id >= (element >> 16 & 0x7ff) && frame.id <= (element & 0x7ff)) return true;
    }
    return (global >> 4 & 0b11) == 0;
  }
  /// The free element with the lowest number.
  std::uint32_t put() const { return static_cast<std::uint32_t>(std::countr_one(pending_)); }
  std::uint32_t head(std::uint32_t index) { return memory_[ram + 0x278 + 72 * index]; }
  /// The bits of the arbitration field in their order, zeros first (ISO 11898-1): base identifier, RTR or SRR, IDE,
  /// then the rest of 29 bits and RTR.
  static std::uint32_t on_the_bus(std::uint32_t head) {
    const std::uint32_t remote = head >> 29 & 1U, id = head & 0x1fff'ffff;
    if ((head & 1U << 30) == 0) return (id >> 18) << 21 | remote << 20;
    return (id >> 18) << 21 | 0b11U << 19 | (id & 0x3'ffff) << 1 | remote;
  }
  bool in_ram(hal::Address address) {
    if (address < ram || address >= ram + 0x2000) {
      require(address >= base && address < base + 0x400, "outside the controller");
      return false;
    }
    require(address < ram + 0x350, "message RAM of another instance");
    return true;
  }
  std::uint32_t cccr_ = 1, interrupts_ = 0xff;
  std::uint32_t get_ = 0, level_ = 0;
  std::uint32_t pending_ = 0;  ///< TXBRP
  std::map<hal::Address, std::uint32_t> memory_;
  bool off_ = false, passive_ = false;
  int sequences_ = 0;
};

}  // namespace fxdyn::test
