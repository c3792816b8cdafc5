#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

// Reset and vector table of a Cortex-M: what the start-up files of the boards share, each of which includes this once.
// Armv7-M Architecture Reference Manual (DDI 0403), B1.5 "exception model"; Armv6-M (DDI 0419) is the same here.

int main();

extern "C" {
// Set by the linker script.
extern std::uint32_t fxdyn_stack_end[];                                            // NOLINT
extern std::uint32_t fxdyn_data_begin[], fxdyn_data_end[], fxdyn_data_in_flash[];  // NOLINT
extern std::uint32_t fxdyn_bss_begin[], fxdyn_bss_end[];                           // NOLINT

// A fault inside the fault handler locks the core up: the emulator then stops with a register dump instead of hanging.
[[noreturn]] void fault_handler() { __builtin_trap(); }

[[noreturn]] void reset_handler() {
#ifdef __ARM_FP
  auto& coprocessor_access = *reinterpret_cast<volatile std::uint32_t*>(0xe000'ed88);  // NOLINT: CPACR (B3.2.20)
  coprocessor_access = coprocessor_access | 0xfU << 20;  // full access to CP10 and CP11, the FPU
  asm volatile("dsb\n isb" ::: "memory");
#endif
  for (std::size_t i = 0; fxdyn_data_begin + i < fxdyn_data_end; ++i) fxdyn_data_begin[i] = fxdyn_data_in_flash[i];
  for (std::uint32_t* word = fxdyn_bss_begin; word < fxdyn_bss_end; ++word) *word = 0;
  main();
  fault_handler();
}
}

namespace fxdyn::hal::cortex_m {

template <std::size_t interrupts>
struct VectorTable {
  std::uint32_t* stack;
  std::array<void (*)(), 15> exceptions;
  std::array<void (*)(), interrupts> interrupts_;
};

/// Reset works, everything else is a fault until the board says otherwise.
template <std::size_t interrupts>
constexpr VectorTable<interrupts> make_vectors() {
  VectorTable<interrupts> table{fxdyn_stack_end, {}, {}};
  table.exceptions.fill(fault_handler);
  table.exceptions[0] = reset_handler;
  table.interrupts_.fill(fault_handler);
  return table;
}

}  // namespace fxdyn::hal::cortex_m
