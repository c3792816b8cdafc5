#pragma once

#include <cstdint>
#include <functional>

#include "tests/hal/models/register_model.hpp"

namespace fxdyn::test {

/// FLASH_ECCR and RCC_CIFR of an STM32G4 (RM0440) as far as they make an NMI: flags that a written 1 clears, a level
/// that calls the handler as long as it is high, and once more where it was high when the handler was not called yet.
class FlashEccModel : public RegisterModel {
 public:
  static constexpr hal::Address eccr = 0x4002'2018, cifr = 0x4002'101c;
  static constexpr std::uint32_t eccd = 1U << 31, eccc = 1U << 30, eccd2 = 1U << 29, eccc2 = 1U << 28,
                                 correction_interrupt = 1U << 24, clock_failed = 1U << 8;
  std::function<bool()> handler;  ///< false: it was a fault
  bool late = false;              ///< the NMI comes when let_in() is called, not with its cause
  int calls = 0, faults = 0;

  FlashEccModel() { registers_[eccr] = correction_interrupt; }
  std::uint32_t status() { return registers_[eccr]; }

  /// A double word that can't be read, or could be corrected. ADDR_ECC holds the first address until its flag is gone.
  void fail(std::uint32_t flag, std::uint32_t address) {
    std::uint32_t& value = registers_[eccr];
    if ((value & flags) == 0) value = (value & ~address_mask) | (address & address_mask);
    value |= flag;
    pending_ = pending_ || (flag & (eccd | eccd2)) != 0;
    if (!late) let_in();
  }
  void stop_the_clock() {
    registers_[cifr] |= clock_failed;
    pending_ = true;
    let_in();
  }
  void let_in() {
    for (int again = 0; pending_ && faults == 0; ++again) {
      pending_ = false;
      ++calls;
      if (!handler()) ++faults;
      pending_ = level();
      if (again == 3) {
        require(false, "the NMI never ends");
        return;
      }
    }
  }

 protected:
  std::uint32_t on_read(hal::Address address) override {
    require(address == eccr || address == cifr, "reads another register");
    return registers_[address];
  }
  void on_write(hal::Address address, std::uint32_t value) override {
    require(address == eccr, "writes a register that only reads");
    std::uint32_t& now = registers_[eccr];
    require((value & correction_interrupt) == (now & correction_interrupt), "changes ECCCIE");
    require((value & (eccc | eccc2)) == 0, "takes back flags of corrections, which are somebody else's");
    now &= ~(value & flags);
  }

 private:
  static constexpr std::uint32_t flags = eccd | eccc | eccd2 | eccc2, address_mask = 0x7'ffff;
  bool level() { return (registers_[eccr] & (eccd | eccd2)) != 0 || (registers_[cifr] & clock_failed) != 0; }
  bool pending_ = false;
};

}  // namespace fxdyn::test
