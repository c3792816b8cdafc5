#pragma once

#include "tests/hal/models/register_model.hpp"

namespace fxdyn::test {

/// RCC, PWR and flash interface of an STM32, with what must hold at the moment of every write. `Part` says what
/// differs.
struct G4 {
  static constexpr hal::Address rcc = 0x4002'1000, flash = 0x4002'2000, pll = rcc + 0x0c, configuration = rcc + 0x08;
  static constexpr std::uint32_t crystal_mhz = 24, switch_to_pll = 0b11, hsi = 0b01, latency = 4, full_mhz = 168;
  static double vco_input(std::uint32_t value) {
    return ((value & 0b11) == 0b11 ? crystal_mhz : 16.0) / ((value >> 4 & 0xf) + 1);
  }
  static double vco(std::uint32_t value) { return vco_input(value) * (value >> 8 & 0x7f); }
  static double output(std::uint32_t value) {
    return (value & 1U << 24) != 0 ? vco(value) / (2 * ((value >> 25 & 0b11) + 1)) : 0;
  }
  static double output_q(std::uint32_t value) {
    return (value & 1U << 20) != 0 ? vco(value) / (2 * ((value >> 21 & 0b11) + 1)) : 0;
  }
  static bool from_crystal(std::uint32_t value) { return (value & 0b11) == 0b11; }
  static bool in_range(std::uint32_t value) {  // data sheet: input 2.66 to 16 MHz, VCO 96 to 344 MHz
    return vco_input(value) >= 2.66 && vco_input(value) <= 16 && vco(value) >= 96 && vco(value) <= 344;
  }
  /// Above 150 MHz the regulator's range 1 needs its boost: PWR_CR5, R1MODE = 0.
  static constexpr hal::Address power = 0x4000'7000, boost = power + 0x80, peripherals = rcc + 0x58;
  static constexpr std::uint32_t r1_mode = 1U << 8, power_clock = 1U << 28;
  static void reset(std::map<hal::Address, std::uint32_t>& registers) {
    registers[boost] = r1_mode;
    registers[power + 0x08] = 1U << 15;  // CR3
  }
  static bool fast_enough(std::map<hal::Address, std::uint32_t>& registers) {
    return (registers[boost] & r1_mode) == 0;
  }
  /// PWR takes nothing without its clock.
  static bool reaches(std::map<hal::Address, std::uint32_t>& registers, hal::Address address) {
    return (address & ~0x3ffU) != power || (registers[peripherals] & power_clock) != 0;
  }
  // RM0440: values after reset, and what of them is a driver's to change.
  static constexpr std::uint32_t control_reset = 0x0000'0500, pll_reset = 0x0000'1000, flash_reset = 0x0004'0600,
                                 pll_fields = 0xff73'7ff3, flash_fields = 0x0000'7f0f;
  static bool half_before_switch(std::uint32_t cfgr) { return (cfgr >> 4 & 0xf) == 0b1000; }
  static bool buses_slow_enough(std::uint32_t) { return true; }
};
struct F4 {
  static constexpr hal::Address rcc = 0x4002'3800, flash = 0x4002'3c00, pll = rcc + 0x04, configuration = rcc + 0x08;
  static constexpr std::uint32_t crystal_mhz = 25, switch_to_pll = 0b10, hsi = 0b00, latency = 5, full_mhz = 168;
  static double vco_input(std::uint32_t value) {
    return ((value & 1U << 22) != 0 ? crystal_mhz : 16.0) / (value & 0x3f);
  }
  static double vco(std::uint32_t value) { return vco_input(value) * (value >> 6 & 0x1ff); }
  static double output(std::uint32_t value) { return vco(value) / (2 * ((value >> 16 & 0b11) + 1)); }
  static bool from_crystal(std::uint32_t value) { return (value & 1U << 22) != 0; }
  static bool in_range(std::uint32_t value) {  // RM0090: input 1 to 2 MHz, VCO 100 to 432 MHz
    return vco_input(value) >= 1 && vco_input(value) <= 2 && vco(value) >= 100 && vco(value) <= 432;
  }
  // RM0090: the same.
  static constexpr std::uint32_t control_reset = 0x0000'0083, pll_reset = 0x2400'3010, flash_reset = 0,
                                 pll_fields = 0x0f43'7fff, flash_fields = 0x0000'1f07;
  static bool half_before_switch(std::uint32_t) { return true; }
  static void reset(std::map<hal::Address, std::uint32_t>&) {}
  static bool fast_enough(std::map<hal::Address, std::uint32_t>&) { return true; }  // PWR_CR: range 1 after reset
  static bool reaches(std::map<hal::Address, std::uint32_t>&, hal::Address) { return true; }
  static bool buses_slow_enough(std::uint32_t cfgr) {  // APB1 at most 42 MHz, APB2 84
    return (cfgr >> 10 & 0b111) >= 0b101 && (cfgr >> 13 & 0b111) >= 0b100;
  }
};

template <class Part>
class RccModel : public RegisterModel {
 public:
  bool crystal_starts = true, pll_locks = true;
  int delay = 20;  ///< reads until a flag follows its bit

  RccModel() {
    registers_[Part::rcc] = Part::control_reset;
    registers_[Part::configuration] = Part::hsi | Part::hsi << 2;
    registers_[Part::pll] = Part::pll_reset;
    registers_[Part::flash] = Part::flash_reset;
    Part::reset(registers_);
  }
  double mhz() {
    const double system = runs_from_pll() ? Part::output(registers_[Part::pll]) : 16;
    return (registers_[Part::configuration] & 0x80) != 0 ? system / 2 : system;
  }
  bool runs_from_pll() { return (registers_[Part::configuration] & 0b11) == Part::switch_to_pll; }

 protected:
  std::uint32_t on_read(hal::Address address) override {
    if (address == Part::rcc) {
      const std::uint32_t value = registers_[address];
      hse_ = (value & 1U << 16) == 0 ? 0 : hse_ + 1;
      pll_ = (value & 1U << 24) == 0 ? 0 : pll_ + 1;
      return value | (crystal_starts && hse_ > delay ? 1U << 17 : 0) | (pll_ready() ? 1U << 25 : 0) | 1U << 10;
    }
    if (address == Part::configuration) ++reads_since_switch_;
    if (address == Part::configuration)
      return (registers_[address] & ~0b1100U) | (registers_[address] & 0b11) << 2;  // SWS follows SW
    return registers_[address];
  }
  void on_write(hal::Address address, std::uint32_t value) override {
    require(Part::reaches(registers_, address), "writes to PWR without its clock");
    if (!Part::reaches(registers_, address)) return;
    if (address == Part::flash)
      require(((value ^ Part::flash_reset) & ~Part::flash_fields) == 0,
              "changes FLASH_ACR beside what is the driver's");
    if (address == Part::pll) {
      require(((value ^ Part::pll_reset) & ~Part::pll_fields) == 0, "changes reserved bits of PLLCFGR");
      require((registers_[Part::rcc] & 1U << 24) == 0, "PLL configured while it is on");
      require(Part::in_range(value), "PLL frequencies out of range");
      require(!Part::from_crystal(value) || (crystal_starts && hse_ > delay), "PLL from a crystal that does not run");
    }
    if (address == Part::configuration && (value & 0b11) == Part::switch_to_pll && !runs_from_pll()) {
      require(pll_ready(), "switches to a PLL that has not locked");
      require((registers_[Part::flash] & 0xf) >= Part::latency, "switches with too few wait states");
      require(Part::half_before_switch(value), "switches above 80 MHz without AHB / 2");
      require(Part::fast_enough(registers_), "switches above 150 MHz without boost");
      reads_since_switch_ = -2;  // neither the one that sees the switch nor that of the next change
      require(Part::buses_slow_enough(value), "switches with buses too fast");
    }
    if (address == Part::configuration && runs_from_pll() && ((registers_[address] ^ value) & 0xf0) != 0)  // HPRE
      require(reads_since_switch_ >= microsecond_of_reads, "full speed sooner than 1 us after the switch");
    if (address == Part::rcc) value &= ~(1U << 10 | 1U << 17 | 1U << 25);  // flags
    if (address == Part::rcc && runs_from_pll())
      require((value & 1U << 24) != 0, "switches the PLL off that it runs from");
    registers_[address] = value;
  }

 private:
  static constexpr int microsecond_of_reads = 42;  // of two cycles each, at 84 MHz
  bool pll_ready() const { return pll_locks && pll_ > delay; }
  int hse_ = 0, pll_ = 0, reads_since_switch_ = 0;
};

/// Independent watchdog (RM0440, RM0090): keys, values that take their time, a counter of LSI / 4 or slower, whose
/// prescaler runs on where it is fed, so that the first count may be over at once.
class IwdgModel : public RegisterModel {
 public:
  static constexpr hal::Address base = 0x4000'3000;
  bool has_reset = false;
  double lsi_khz = 32;
  double first_count = 1;  ///< how much of it is left when it is fed: above 0, 1 at most

  void pass_ms(double ms) {
    if (!running_) return;
    left_ms_ -= ms;
    has_reset = has_reset || left_ms_ <= 0;
  }
  bool running() const { return running_; }

 protected:
  std::uint32_t on_read(hal::Address address) override {
    if (address != base + 0x0c) return registers_[address];
    if (busy_ > 0) --busy_;
    return busy_ > 0 ? 0b11 : 0;
  }
  void on_write(hal::Address address, std::uint32_t value) override {
    if (address == base) {
      if (value == 0xcccc) running_ = true, left_ms_ = 512;
      if (value == 0xaaaa) left_ms_ = period_ms();
      open_ = value == 0x5555;
      return;
    }
    require(open_, "PR and RLR are locked");
    require(busy_ == 0 || address != last_, "writes while an update is under way");
    if (open_) registers_[address] = value;
    last_ = address;
    busy_ = 10;
  }

 private:
  double period_ms() {
    require(registers_[base + 0x08] <= 0xfff, "RLR has 12 bits");
    return (registers_[base + 0x08] + first_count) * 4.0 * (1 << (registers_[base + 0x04] & 0b111)) / lsi_khz;
  }
  bool running_ = false, open_ = false;
  double left_ms_ = 0;
  int busy_ = 0;
  hal::Address last_ = 0;
};

/// System watchdog of the Zynq UltraScale+ (UG1087, module SWDT): keys, a counter of 100 MHz / 8, 64, 512 or 4096 that
/// restarts at 0xNNNFFF.
class SwdtModel : public RegisterModel {
 public:
  static constexpr hal::Address base = 0xff15'0000;
  bool has_timed_out = false, clocked = true;

  SwdtModel() { registers_[base] = 0x1c2; }
  bool running() { return (registers_[base] & 0b11) == 0b11; }  // RSTEN, WDEN
  void pass_ms(double ms) {
    if (!running()) return;
    left_ms_ -= ms;
    has_timed_out = has_timed_out || left_ms_ <= 0;
  }

 protected:
  std::uint32_t on_read(hal::Address address) override {
    require(address == base || address == base + 0x4 || address == base + 0xc, "reads a register that only writes");
    return clocked ? registers_[address] : 0;
  }
  void on_write(hal::Address address, std::uint32_t value) override {
    if (!clocked) return;
    switch (address - base) {
      case 0x0:
        require(value >> 12 == 0xabc && (value & 0xe08) == 0, "MODE: key or reserved bits");
        if ((registers_[base] & 1U) == 0) left_ms_ = period_ms();
        registers_[base] = value & 0xfff;
        return;
      case 0x4:
        require(value >> 14 == 0x248, "CONTROL: key");
        require((registers_[base] & 1U) == 0, "CONTROL changes under a running watchdog");
        registers_[address] = value & 0x3fff;
        return;
      case 0x8:
        require(value == 0x1999, "RESTART: key");
        left_ms_ = period_ms();
        return;
      default:
        require(false, "writes offset " + std::to_string(address - base));
    }
  }

 private:
  double period_ms() {
    const std::uint32_t control = registers_[base + 0x4];
    return ((control >> 2) + 1) * 4096.0 * (8 << 3 * (control & 0b11)) / 100'000;
  }
  double left_ms_ = 0;
};

/// A few registers without behaviour, for what only sets them.
class PlainModel : public RegisterModel {
 public:
  std::uint32_t& at(hal::Address address) { return registers_[address]; }
  std::vector<std::pair<hal::Address, std::uint32_t>> writes;

 protected:
  std::uint32_t on_read(hal::Address address) override { return registers_[address]; }
  void on_write(hal::Address address, std::uint32_t value) override {
    registers_[address] = value;
    writes.emplace_back(address, value);
  }
};

}  // namespace fxdyn::test
