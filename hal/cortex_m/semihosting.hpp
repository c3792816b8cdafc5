#pragma once

#include <array>
#include <cstdint>

// A debugger or an emulator does the printing. "Semihosting for AArch32 and AArch64" (Arm IHI 0100).

namespace fxdyn::hal::semihosting {

inline void call(std::uint32_t operation, const void* argument) {
  register std::uint32_t r0 asm("r0") = operation;
  register const void* r1 asm("r1") = argument;
  asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

inline void print(const char* text) { call(0x04, text); }  // SYS_WRITE0

/// Decimal without a division, which the image must not contain.
inline void print(std::uint32_t number) {
  static constexpr std::array<std::uint32_t, 10> powers{1'000'000'000, 100'000'000, 10'000'000, 1'000'000, 100'000,
                                                        10'000,        1'000,       100,        10,        1};
  std::array<char, 11> digits{};
  std::size_t size = 0;
  for (const std::uint32_t power : powers) {
    char digit = '0';
    for (; number >= power; number -= power) ++digit;
    if (digit != '0' || size > 0 || power == 1) digits[size++] = digit;
  }
  print(digits.data());
}

[[noreturn]] inline void exit(std::uint32_t code) {
  const std::array<std::uint32_t, 2> argument{0x20026, code};  // ADP_Stopped_ApplicationExit
  call(0x20, argument.data());                                 // SYS_EXIT_EXTENDED
  __builtin_trap();
}

}  // namespace fxdyn::hal::semihosting
