#pragma once

#include <cstdint>

#include "hal/gpio.hpp"
#include "hal/registers.hpp"

// GPIO ports of the STM32F4 and G4, which are alike: RM0440 and RM0090, "General-purpose I/Os". The port's clock must
// be on (RCC).

namespace fxdyn::hal::stm32 {

enum class Pull : std::uint32_t { none = 0, up = 1, down = 2 };

namespace detail {
enum class Mode : std::uint32_t { input = 0, output = 1, alternate = 2 };

template <Registers R>
void configure(R& registers, Address port, std::uint32_t number, Mode mode, Pull pull) {
  registers.write(port + 0x0c, (registers.read(port + 0x0c) & ~(3U << 2 * number)) | static_cast<std::uint32_t>(pull)
                                                                                         << 2 * number);  // PUPDR
  registers.write(port + 0x00, (registers.read(port + 0x00) & ~(3U << 2 * number)) | static_cast<std::uint32_t>(mode)
                                                                                         << 2 * number);  // MODER
}
}  // namespace detail

/// Hands a pin to a peripheral: alternate function `function` of the data sheet, fast edges.
template <Registers R>
void use_alternate_function(R& registers, Address port, std::uint32_t number, std::uint32_t function) {
  const Address afr = port + (number < 8 ? 0x20 : 0x24);  // AFRL, AFRH
  const std::uint32_t shift = 4 * (number % 8);
  set_field(registers, afr, 0xfU << shift, function << shift);
  set_field(registers, port + 0x08, 3U << 2 * number, 2U << 2 * number);  // OSPEEDR: high speed
  detail::configure(registers, port, number, detail::Mode::alternate, Pull::up);
}

/// BSRR sets or clears one pin in one access.
template <Address port, std::uint32_t number, bool active_high, Registers R = MemoryMapped>
class OutputPin {
 public:
  explicit OutputPin(R registers = {}) : OutputPin(AtStart::off, registers) {}
  explicit OutputPin(AtStart start, R registers = {}) : registers_(registers) {
    write((start == AtStart::on) == active_high);  // the level first: the change of mode must not make a pulse
    detail::configure(registers_, port, number, detail::Mode::output, Pull::none);
  }
  Status set(bool on) {
    write(on == active_high);
    return Status::ok;
  }

 private:
  void write(bool high) { registers_.write(port + 0x18, 1U << (high ? number : number + 16)); }
  [[no_unique_address]] R registers_;
};

/// Pulled to the level that is not active: a broken wire reads as off.
template <Address port, std::uint32_t number, bool active_high, Registers R = MemoryMapped>
class InputPin {
 public:
  explicit InputPin(R registers = {}) : registers_(registers) {
    detail::configure(registers_, port, number, detail::Mode::input, active_high ? Pull::down : Pull::up);
  }
  Status read(bool& on) {
    on = ((registers_.read(port + 0x10) >> number & 1U) != 0) == active_high;  // IDR
    return Status::ok;
  }

 private:
  [[no_unique_address]] R registers_;
};

static_assert(hal::OutputPin<OutputPin<0, 0, true>>);
static_assert(hal::InputPin<InputPin<0, 0, true>>);

}  // namespace fxdyn::hal::stm32
