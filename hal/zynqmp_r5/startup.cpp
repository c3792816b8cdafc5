// Start of a Cortex-R5F of the Zynq UltraScale+, at 0x00100000 in DDR memory, in Arm state and supervisor mode.
// Armv7-R Architecture Reference Manual (DDI 0406), "Exceptions"; Cortex-R5 Technical Reference Manual (DDI 0460),
// "System control".

#include <cstddef>
#include <cstdint>

int main();

extern "C" {
// Set by the linker script.
extern std::uint32_t fxdyn_data_begin[], fxdyn_data_end[], fxdyn_data_in_flash[];  // NOLINT
extern std::uint32_t fxdyn_bss_begin[], fxdyn_bss_end[];                           // NOLINT

// A fault stays here, where a debugger finds it, until the watchdog resets.
[[noreturn]] void fault_handler() {
  for (;;) asm volatile("");
}

[[noreturn, gnu::target("arm")]] void start() {
  auto* exceptions = reinterpret_cast<volatile std::uint32_t*>(0);  // NOLINT: the tightly coupled memory begins there
  asm volatile("" : "+r"(exceptions));                              // no null pointer
  for (std::size_t i = 0; i < 8; ++i) {
    exceptions[i] = 0xe59f'f018;  // ldr pc, [pc, #24]: the word 32 bytes further on
    exceptions[8 + i] = static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(&fault_handler));  // NOLINT
  }
  for (std::size_t i = 0; fxdyn_data_begin + i < fxdyn_data_end; ++i) fxdyn_data_begin[i] = fxdyn_data_in_flash[i];
  for (std::uint32_t* word = fxdyn_bss_begin; word < fxdyn_bss_end; ++word) *word = 0;
  asm volatile("mcr p15, 0, %0, c15, c5, 0" ::"r"(0));  // invalidate all data cache (DDI 0460, "c15 system control")
  asm volatile("mcr p15, 0, %0, c7, c5, 0" ::"r"(0));   // ICIALLU
  std::uint32_t control;
  asm volatile("mrc p15, 0, %0, c1, c0, 0" : "=r"(control));
  control &= ~(1U << 13);                    // SCTLR.V: exceptions at 0
  control |= 1U << 2 | 1U << 11 | 1U << 12;  // C, Z, I: caches and branch prediction
  asm volatile("mcr p15, 0, %0, c1, c0, 0\n isb" ::"r"(control) : "memory");
  main();
  fault_handler();
}

// Where the processor begins, in Arm state: no stack yet.
[[noreturn, gnu::naked, gnu::target("arm"), gnu::section(".vectors"), gnu::used]] void reset_handler() {
  asm volatile(
      "ldr sp, =fxdyn_stack_end\n"
      "b start\n"
      ".ltorg\n");
}
}
