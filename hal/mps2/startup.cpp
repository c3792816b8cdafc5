// Vector table and reset of the MPS2 boards. Armv7-M Architecture Reference Manual (DDI 0403), B1.5 "exception model".

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/mps2/board.hpp"

int main();

extern "C" {
// Set by the linker script.
extern std::uint32_t fxdyn_stack_end[];                                            // NOLINT
extern std::uint32_t fxdyn_data_begin[], fxdyn_data_end[], fxdyn_data_in_flash[];  // NOLINT
extern std::uint32_t fxdyn_bss_begin[], fxdyn_bss_end[];                           // NOLINT

// Defined by the image's main file.
void uart0_receive_handler();

// A fault inside the fault handler locks the core up: the emulator then stops with a register dump instead of hanging.
[[noreturn]] void fault_handler() { __builtin_trap(); }

[[noreturn]] void reset_handler() {
#ifdef __ARM_FP
  fxdyn::hal::mps2::reg(0xe000'ed88) |= 0xfU << 20;  // CPACR: full access to CP10 and CP11, the FPU (B3.2.20)
  asm volatile("dsb\n isb" ::: "memory");
#endif
  for (std::size_t i = 0; fxdyn_data_begin + i < fxdyn_data_end; ++i) fxdyn_data_begin[i] = fxdyn_data_in_flash[i];
  for (std::uint32_t* word = fxdyn_bss_begin; word < fxdyn_bss_end; ++word) *word = 0;
  main();
  fault_handler();
}
}

namespace {

struct VectorTable {
  std::uint32_t* stack;
  std::array<void (*)(), 15> exceptions;
  std::array<void (*)(), fxdyn::hal::mps2::uart0_receive_interrupt + 1> interrupts;
};

constexpr VectorTable make_vectors() {
  VectorTable table{fxdyn_stack_end, {}, {}};
  table.exceptions.fill(fault_handler);
  table.exceptions[0] = reset_handler;
  table.interrupts.fill(fault_handler);
  table.interrupts.back() = uart0_receive_handler;
  return table;
}

[[gnu::section(".vectors"), gnu::used]] constexpr VectorTable vectors = make_vectors();

}  // namespace
