#pragma once

#include <cstdint>

// What differs between the FPGA images of the Arm MPS2 board. Addresses and interrupts: Arm application notes AN385,
// AN386 and AN500 (sections "Memory map", "Interrupt map") and AN505 for the Cortex-M33 in its secure state.

namespace fxdyn::hal::mps2 {

#ifdef FXDYN_MPS2_AN505
inline constexpr std::uintptr_t uart0_address = 0x5020'0000;
inline constexpr std::uint32_t uart0_receive_interrupt = 32;
inline constexpr std::uint32_t clock_hz = 20'000'000;
#else
inline constexpr std::uintptr_t uart0_address = 0x4000'4000;
inline constexpr std::uint32_t uart0_receive_interrupt = 0;
inline constexpr std::uint32_t clock_hz = 25'000'000;
#endif

/// A memory-mapped register.
inline volatile std::uint32_t& reg(std::uintptr_t address) {
  return *reinterpret_cast<volatile std::uint32_t*>(address);  // NOLINT: that is what a register is
}

inline void mask_interrupts() { asm volatile("cpsid i" ::: "memory"); }
inline void unmask_interrupts() { asm volatile("cpsie i" ::: "memory"); }

}  // namespace fxdyn::hal::mps2
