#pragma once

#include <concepts>
#include <cstdint>

namespace fxdyn::hal {

/// How a driver reaches its registers: on the target through memory, in a host's test through a model of the
/// peripheral. `Address` holds an address of the target, which all have 32 bits.
using Address = std::uint32_t;

template <class T>
concept Registers = requires(T& registers, Address address, std::uint32_t value) {
  { registers.read(address) } -> std::same_as<std::uint32_t>;
  { registers.write(address, value) } -> std::same_as<void>;
};

/// Registers in the processor's address space.
struct MemoryMapped {
  static std::uint32_t read(Address address) {
    return *reinterpret_cast<const volatile std::uint32_t*>(
        static_cast<std::uintptr_t>(address));  // NOLINT: a register
  }
  static void write(Address address, std::uint32_t value) {
    *reinterpret_cast<volatile std::uint32_t*>(static_cast<std::uintptr_t>(address)) = value;  // NOLINT: a register
  }
};
static_assert(Registers<MemoryMapped>);

template <Registers R>
void set_bits(R& registers, Address address, std::uint32_t bits) {
  registers.write(address, registers.read(address) | bits);
}
template <Registers R>
void clear_bits(R& registers, Address address, std::uint32_t bits) {
  registers.write(address, registers.read(address) & ~bits);
}
/// Writes `value` into the field `mask`.
template <Registers R>
void set_field(R& registers, Address address, std::uint32_t mask, std::uint32_t value) {
  registers.write(address, (registers.read(address) & ~mask) | value);
}

/// Reads until all `bits` are set (or, with `cleared`, none is), at most `tries` times. False: they did not come.
template <Registers R>
bool wait_for(R& registers, Address address, std::uint32_t bits, std::uint32_t tries, bool cleared = false) {
  for (; tries > 0; --tries) {
    const std::uint32_t value = registers.read(address) & bits;
    if (cleared ? value == 0 : value == bits) return true;
  }
  return false;
}

}  // namespace fxdyn::hal
