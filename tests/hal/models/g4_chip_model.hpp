#pragma once

#include "tests/hal/models/clock_models.hpp"
#include "tests/hal/models/fdcan_model.hpp"

namespace fxdyn::test {

/// What of an STM32G474 stands between its reset and a frame on the bus: RCC, PWR, GPIO, TIM2, TIM6 and FDCAN1, each of
/// which needs its clock first (RM0440).
class G4ChipModel : public RccModel<G4> {
 public:
  static constexpr hal::Address gpio_a = 0x4800'0000, gpio_b = 0x4800'0400, tim2 = 0x4000'0000, tim6 = 0x4000'1000;
  FdcanModel can;

  G4ChipModel() {  // "GPIO registers": reset values, with the pins of JTAG and SWD
    registers_[gpio_a] = 0xabff'ffff;
    registers_[gpio_a + 0x08] = 0x0c00'0000;
    registers_[gpio_a + 0x0c] = 0x6400'0000;
    registers_[gpio_b] = 0xffff'febf;
    registers_[gpio_b + 0x08] = 0x0000'00c0;
    registers_[gpio_b + 0x0c] = 0x0000'0100;
  }

  std::uint32_t mode(hal::Address port, std::uint32_t pin) { return registers_[port] >> 2 * pin & 0b11; }
  std::uint32_t pull(hal::Address port, std::uint32_t pin) { return registers_[port + 0x0c] >> 2 * pin & 0b11; }
  std::uint32_t function(hal::Address port, std::uint32_t pin) {
    return registers_[port + (pin < 8 ? 0x20 : 0x24)] >> 4 * (pin % 8) & 0xf;
  }
  bool driven_high(hal::Address port, std::uint32_t pin) {
    return mode(port, pin) == 1 && (registers_[port + 0x14] >> pin & 1U) != 0;
  }
  bool driven_low(hal::Address port, std::uint32_t pin) {
    return mode(port, pin) == 1 && (registers_[port + 0x14] >> pin & 1U) == 0;
  }
  void outside(hal::Address port, std::uint32_t pin, bool high) {
    registers_[port + 0x10] = (registers_[port + 0x10] & ~(1U << pin)) | (high ? 1U << pin : 0);
  }

  void reset_flags(std::uint32_t flags) { registers_[status] = flags; }

  /// Of the CAN controller's bits: CCIPR, FDCANSEL.
  double can_mhz() {
    const std::uint32_t source = registers_[G4::rcc + 0x88] >> 24 & 0b11;
    if (source == 0b01) return runs_from_pll() ? G4::output_q(registers_[G4::pll]) : 0;
    return source == 0b10 ? mhz() : 0;
  }
  /// What TIM2 counts a second, by the prescaler that an update has taken over.
  double counts_mhz() { return counting_ ? mhz() / (prescaler_ + 1) : 0; }

 protected:
  std::uint32_t on_read(hal::Address address) override {
    if (!has_clock(address)) return 0;
    return of_can(address) ? can.read(address) : RccModel::on_read(address);
  }
  void on_write(hal::Address address, std::uint32_t value) override {
    require(has_clock(address), "writes to a peripheral without its clock");
    if (!has_clock(address)) return;
    if (of_can(address)) return can.write(address, value);
    if (address == gpio_a + 0x18 || address == gpio_b + 0x18) {
      std::uint32_t& levels = registers_[address - 0x04];  // BSRR, ODR
      levels = (levels & ~(value >> 16)) | (value & 0xffff);
      return;
    }
    if (address == status) {  // RCC_CSR: RMVF clears the flags
      if ((value & 1U << 23) != 0) registers_[status] &= 0x007f'ffff;
      return;
    }
    if (address == gpio_b)
      require((registers_[G4::power + 0x08] & 1U << 14) != 0, "PB4 or PB6 in use, still pulled down by UCPD");
    if (address == tim2 + 0x14 && (value & 1U) != 0) prescaler_ = registers_[tim2 + 0x28];  // UG
    if (address == tim2) counting_ = (value & 1U) != 0;
    RccModel::on_write(address, value);
  }

 private:
  static constexpr hal::Address status = G4::rcc + 0x94;
  static bool of_can(hal::Address address) {
    return address - FdcanModel::base < 0x400 || address - FdcanModel::ram < 0x400;
  }
  bool has_clock(hal::Address address) {
    const std::uint32_t ports = registers_[G4::rcc + 0x4c], peripherals = registers_[G4::peripherals];
    if (address - gpio_a < 0x400) return (ports & 1U << 0) != 0;
    if (address - gpio_b < 0x400) return (ports & 1U << 1) != 0;
    if (address - tim2 < 0x400) return (peripherals & 1U << 0) != 0;
    if (address - tim6 < 0x400) return (peripherals & 1U << 4) != 0;
    return !of_can(address) || ((peripherals & 1U << 25) != 0 && can_mhz() > 0);
  }
  bool counting_ = false;
  std::uint32_t prescaler_ = 0;
};

}  // namespace fxdyn::test
