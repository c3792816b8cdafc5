#pragma once

#include <cstdint>

#include "hal/gpio.hpp"
#include "hal/zynqmp_r5/board.hpp"

namespace fxdyn::hal::zynqmp_r5 {

/// MIO pin 0..25 (UG1087, module GPIO, bank 0). MASK_DATA_0_LSW and _MSW change the pins whose bit in the upper half is
/// zero, in one access. Pin multiplexing is the boot loader's.
template <int number, bool active_high, Registers R = MemoryMapped>
class OutputPin {
  static_assert(number >= 0 && number < 26);

 public:
  explicit OutputPin(R registers = {}) : OutputPin(AtStart::off, registers) {}
  explicit OutputPin(AtStart start, R registers = {}) : registers_(registers) {
    write((start == AtStart::on) == active_high);      // the level first: enabling the output must not make a pulse
    set_bits(registers_, gpio + 0x204, 1U << number);  // DIRM_0
    set_bits(registers_, gpio + 0x208, 1U << number);  // OEN_0
  }
  Status set(bool on) {
    write(on == active_high);
    return Status::ok;
  }

 private:
  void write(bool high) {
    constexpr std::uint32_t bit = 1U << number % 16;
    registers_.write(gpio + (number < 16 ? 0x0 : 0x4), (~bit & 0xffff) << 16 | (high ? bit : 0));
  }
  [[no_unique_address]] R registers_;
};

template <int number, bool active_high, Registers R = MemoryMapped>
class InputPin {
  static_assert(number >= 0 && number < 26);

 public:
  explicit InputPin(R registers = {}) : registers_(registers) { clear_bits(registers_, gpio + 0x204, 1U << number); }
  Status read(bool& on) {
    on = ((registers_.read(gpio + 0x60) >> number & 1U) != 0) == active_high;  // DATA_0_RO
    return Status::ok;
  }

 private:
  [[no_unique_address]] R registers_;
};

static_assert(hal::OutputPin<OutputPin<0, true>>);
static_assert(hal::InputPin<InputPin<0, true>>);

}  // namespace fxdyn::hal::zynqmp_r5
