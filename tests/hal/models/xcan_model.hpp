#pragma once

#include <array>
#include <deque>

#include "tests/hal/models/register_model.hpp"

namespace fxdyn::test {

/// CAN controller 0 of the Zynq UltraScale+ (UG1085 chapter "CAN Controller", UG1087 module CAN).
class XcanModel : public RegisterModel {
 public:
  static constexpr hal::Address base = 0xff06'0000;
  using Words = std::array<std::uint32_t, 4>;
  std::deque<Words> sent;
  bool stuck = false;  ///< never leaves configuration mode

  bool configuring() const { return !enabled_; }
  std::uint32_t value(hal::Address offset) { return registers_[base + offset]; }
  void arrives(const Words& words) {
    if (!enabled_ || off_) return;
    if (received_.size() == 64) {
      isr_ |= 1U << 6;
      return;
    }
    received_.push_back(words);
    isr_ |= 1U << 4;
  }
  void set_counters(std::uint32_t transmit, std::uint32_t receive) {
    tec_ = transmit, rec_ = receive;
    off_ = transmit > 255;
  }
  void fill_transmit_fifo() { full_ = true; }
  void drain_transmit_fifo() { full_ = false; }

 protected:
  std::uint32_t on_read(hal::Address address) override {
    switch (address - base) {
      case 0x00:
        return enabled_ ? 0b10 : 0;
      case 0x10:
        return (tec_ & 0xff) | rec_ << 8;
      case 0x18:
        if (!enabled_) return 1;
        return (stuck ? 0 : 1U << 3) |
               (off_                       ? 0b10U
                : tec_ > 127 || rec_ > 127 ? 0b11U
                                           : 0b01U)
                   << 7 |
               (full_ ? 1U << 10 : 0);
      case 0x1c:
        return isr_ | (received_.empty() ? 0 : 1U << 7);
      case 0x50:
      case 0x54:
      case 0x58:
      case 0x5c: {
        const std::uint32_t word = (address - base - 0x50) / 4;
        require(!received_.empty(), "reads an empty FIFO");
        require(word == next_read_, "reads the four words out of order");
        if (received_.empty()) return 0xdead'beef;
        const std::uint32_t value = received_.front()[word];
        next_read_ = (next_read_ + 1) % 4;
        if (word == 3) received_.pop_front();
        return value;
      }
      default:
        return registers_[address];
    }
  }
  void on_write(hal::Address address, std::uint32_t value) override {
    switch (address - base) {
      case 0x00:
        if ((value & 1U) != 0) {
          *this = reset_state();
          return;
        }
        require(!off_ || (value & 0b10) == 0, "enables a controller that is off the bus without a reset");
        enabled_ = (value & 0b10) != 0;
        return;
      case 0x04:
      case 0x08:
      case 0x0c:
        require(!enabled_, "configuration while CEN is set");
        registers_[address] = value;
        return;
      case 0x60:
      case 0x20:
        registers_[address] = value;
        return;
      case 0x24:
        isr_ &= ~value;
        return;
      case 0x30:
      case 0x34:
      case 0x38:
      case 0x3c: {
        const std::uint32_t word = (address - base - 0x30) / 4;
        require(word == next_write_, "writes the four words out of order");
        require(!full_, "writes to a full FIFO");
        require(enabled_ && !off_, "sends while off the bus");
        building_[word] = value;
        next_write_ = (next_write_ + 1) % 4;
        if (word == 3) sent.push_back(building_);
        return;
      }
      default:
        require(false, "writes offset " + std::to_string(address - base));
    }
  }

 private:
  XcanModel reset_state() const {
    XcanModel fresh;
    fresh.violations = violations;
    fresh.sent = sent;
    fresh.stuck = stuck;
    return fresh;
  }
  bool enabled_ = false, off_ = false, full_ = false;
  std::uint32_t isr_ = 0, tec_ = 0, rec_ = 0, next_read_ = 0, next_write_ = 0;
  std::deque<Words> received_;
  Words building_{};
};

}  // namespace fxdyn::test
