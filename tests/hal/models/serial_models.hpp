#pragma once

#include <deque>
#include <vector>

#include "tests/hal/models/register_model.hpp"

namespace fxdyn::test {

/// CMSDK APB UART (DDI 0479): one byte of buffer in each direction.
class CmsdkUartModel : public RegisterModel {
 public:
  explicit CmsdkUartModel(hal::Address base) : base_(base) {}
  std::vector<std::uint8_t> sent;
  bool transmit_full = false;

  /// False: the byte before has not been read, and this one is lost.
  bool arrives(std::uint8_t byte) {
    if ((registers_[base_ + 0x08] & 0b10) == 0) return false;
    if (full_) return false;
    received_ = byte;
    full_ = true;
    if ((registers_[base_ + 0x08] & 1U << 3) != 0) interrupts_ |= 0b10;
    return true;
  }
  bool interrupt() const { return interrupts_ != 0; }
  /// Another byte arrives the moment the driver has read one, still in its interrupt.
  bool byte_comes_between = false;

 protected:
  std::uint32_t on_read(hal::Address address) override {
    switch (address - base_) {
      case 0x00:
        require(full_, "reads DATA without a byte");
        {
          const std::uint32_t byte = received_;
          full_ = false;
          if (byte_comes_between) arrives('!');
          byte_comes_between = false;
          return byte;
        }
      case 0x04:
        return (transmit_full ? 1U : 0) | (full_ ? 0b10U : 0);
      case 0x0c:
        return interrupts_;
      default:
        return registers_[address];
    }
  }
  void on_write(hal::Address address, std::uint32_t value) override {
    switch (address - base_) {
      case 0x00:
        require((registers_[base_ + 0x08] & 1U) != 0, "sends while the transmitter is off");
        require(!transmit_full, "overruns the transmitter");
        sent.push_back(static_cast<std::uint8_t>(value));
        return;
      case 0x0c:
        interrupts_ &= ~value;
        return;
      case 0x10:
        require(value >= 16, "BAUDDIV is 16 at least");
        require((registers_[base_ + 0x08] & 0b11) == 0, "BAUDDIV while it runs");
        registers_[address] = value;
        return;
      case 0x08:
        require(registers_[base_ + 0x10] >= 16, "enables without a baud rate");
        registers_[address] = value;
        return;
      default:
        require(false, "writes offset " + std::to_string(address - base_));
    }
  }

 private:
  hal::Address base_;
  std::uint32_t interrupts_ = 0;
  std::uint8_t received_ = 0;
  bool full_ = false;
};

/// USART of the STM32F4 (RM0090): RXNE, TXE, ORE; reading SR and then DR clears RXNE and ORE.
class UsartModel : public RegisterModel {
 public:
  static constexpr hal::Address base = 0x4001'1000;
  std::vector<std::uint8_t> sent;
  bool transmit_full = false;

  void arrives(std::uint8_t byte) {
    if ((registers_[base + 0x0c] & (1U << 13 | 1U << 2)) != (1U << 13 | 1U << 2)) return;
    if ((status_ & 1U << 5) != 0) {
      status_ |= 1U << 3;  // ORE: the byte is lost
      return;
    }
    received_ = byte;
    status_ |= 1U << 5;
  }
  bool interrupt() { return (registers_[base + 0x0c] & 1U << 5) != 0 && (status_ & (1U << 5 | 1U << 3)) != 0; }

 protected:
  std::uint32_t on_read(hal::Address address) override {
    switch (address - base) {
      case 0x00:
        looked_ = true;
        return status_ | (transmit_full ? 0 : 1U << 7);
      case 0x04:
        if (looked_) status_ &= ~(1U << 5 | 1U << 3);
        looked_ = false;
        return received_;
      default:
        return registers_[address];
    }
  }
  void on_write(hal::Address address, std::uint32_t value) override {
    if (address == base + 0x04) {
      require((registers_[base + 0x0c] & (1U << 13 | 1U << 3)) == (1U << 13 | 1U << 3), "sends while it is off");
      require(!transmit_full, "overruns the transmitter");
      sent.push_back(static_cast<std::uint8_t>(value));
      return;
    }
    if (address == base + 0x08) require((registers_[base + 0x0c] & 1U << 13) == 0, "BRR while it runs");
    registers_[address] = value;
  }

 private:
  std::uint32_t status_ = 0;
  std::uint8_t received_ = 0;
  bool looked_ = false;
};

}  // namespace fxdyn::test
