#pragma once

#include <cstdint>

#include "hal/gpio.hpp"
#include "hal/mps2/board.hpp"

namespace fxdyn::hal::mps2 {

/// A pin of GPIO0 (expansion pins EXP0 to EXP15). Registers: Cortex-M System Design Kit Technical Reference Manual
/// (DDI 0479), "AHB GPIO". Writes go through MASKLOWBYTE and MASKHIGHBYTE, whose address says which pins they change:
/// one access, so that two users of the port need not know of each other.
template <int number, bool active_high, Registers R = MemoryMapped>
class OutputPin {
  static_assert(number >= 0 && number < 16);

 public:
  explicit OutputPin(R registers = {}) : OutputPin(AtStart::off, registers) {}
  explicit OutputPin(AtStart start, R registers = {}) : registers_(registers) {
    write((start == AtStart::on) == active_high);          // the level first: enabling the output must not make a pulse
    registers_.write(gpio0_address + 0x10, 1U << number);  // OUTENSET
  }
  Status set(bool on) {
    write(on == active_high);
    return Status::ok;
  }

 private:
  void write(bool high) {
    constexpr std::uint32_t bit = number % 8, byte = number < 8 ? 0x400 : 0x800;
    registers_.write(gpio0_address + byte + (1U << bit) * 4, high ? 1U << number : 0);
  }
  [[no_unique_address]] R registers_;
};

template <int number, bool active_high, Registers R = MemoryMapped>
class InputPin {
  static_assert(number >= 0 && number < 16);

 public:
  explicit InputPin(R registers = {}) : registers_(registers) {
    registers_.write(gpio0_address + 0x14, 1U << number);  // OUTENCLR
  }
  Status read(bool& on) {
    on = ((registers_.read(gpio0_address) >> number & 1U) != 0) == active_high;  // DATA
    return Status::ok;
  }

 private:
  [[no_unique_address]] R registers_;
};

static_assert(hal::OutputPin<OutputPin<0, true>>);
static_assert(hal::InputPin<InputPin<0, true>>);

}  // namespace fxdyn::hal::mps2
