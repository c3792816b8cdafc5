#pragma once

#include <array>
#include <deque>
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
  /// The oldest frame that waits goes out onto the bus.
  std::optional<Sent> transmit() {
    if (pending_.empty() || initialising() || off_) return {};
    const std::uint32_t index = pending_.front();
    pending_.pop_front();
    const hal::Address element = ram + 0x278 + 72 * index;
    Sent sent{memory_[element], memory_[element + 4], {}};
    for (std::uint32_t i = 0; i < 16; ++i) sent.words[i] = memory_[element + 8 + 4 * i];
    return sent;
  }
  std::size_t waiting() const { return pending_.size(); }

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
        return static_cast<std::uint32_t>(3 - pending_.size()) | put_ << 16 | (pending_.size() == 3 ? 1U << 21 : 0);
      default:
        return registers_[address];
    }
  }
  void on_write(hal::Address address, std::uint32_t value) override {
    if (!clocked) return;
    if (in_ram(address)) {
      require(address % 4 == 0, "message RAM is written in words");
      if (address >= ram + 0x278 && !initialising())
        require((address - ram - 0x278) / 72 == put_ && pending_.size() < 3, "writes an element that may be in use");
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
        require(open, "configuration needs INIT and CCE");
        if (open) registers_[address] = value;
        return;
      case 0x40:
      case 0x44:
      case 0x90:
      case 0xc4:
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
        require(value == 1U << put_ && pending_.size() < 3, "asks to send another element than the put index");
        pending_.push_back(put_);
        put_ = (put_ + 1) % 3;
        return;
      case 0xd0:
        pending_.clear();
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
  bool in_ram(hal::Address address) {
    if (address < ram || address >= ram + 0x2000) {
      require(address >= base && address < base + 0x400, "outside the controller");
      return false;
    }
    require(address < ram + 0x350, "message RAM of another instance");
    return true;
  }
  std::uint32_t cccr_ = 1, interrupts_ = 0xff;
  std::uint32_t get_ = 0, level_ = 0, put_ = 0;
  std::deque<std::uint32_t> pending_;
  std::map<hal::Address, std::uint32_t> memory_;
  bool off_ = false, passive_ = false;
  int sequences_ = 0;
};

}  // namespace fxdyn::test
