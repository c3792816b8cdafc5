#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "hal/registers.hpp"

namespace fxdyn::test {

/// A peripheral as its reference manual describes it, for a driver under test. What the manual forbids is written down
/// in `violations` instead of being forgiven.
class RegisterModel {
 public:
  std::vector<std::string> violations;
  std::vector<std::uint32_t> interrupts;  ///< numbers let through in the NVIC

  virtual ~RegisterModel() = default;

  std::uint32_t read(hal::Address address) {
    if (in_nvic(address)) return 0;
    return on_read(address);
  }
  void write(hal::Address address, std::uint32_t value) {
    if (!in_nvic(address)) return on_write(address, value);
    for (std::uint32_t bit = 0; bit < 32; ++bit)
      if ((value >> bit & 1U) != 0) interrupts.push_back(8 * (address - 0xe000'e100) + bit);
  }

 protected:
  virtual std::uint32_t on_read(hal::Address address) = 0;
  virtual void on_write(hal::Address address, std::uint32_t value) = 0;
  void require(bool allowed, const std::string& what) {
    if (!allowed) violations.push_back(what);
  }
  std::map<hal::Address, std::uint32_t> registers_;

 private:
  static bool in_nvic(hal::Address address) { return address >= 0xe000'e100 && address < 0xe000'e140; }
};

/// What a driver holds in place of hal::MemoryMapped.
struct Modelled {
  RegisterModel* model = nullptr;
  std::uint32_t read(hal::Address address) const { return model->read(address); }
  void write(hal::Address address, std::uint32_t value) const { model->write(address, value); }
};
static_assert(hal::Registers<Modelled>);

/// Moved on by hand.
struct FakeClock {
  std::uint32_t us = 0;
  std::uint32_t now_us() const { return us; }
};

}  // namespace fxdyn::test
