#pragma once

#include <cstdint>

#include "hal/registers.hpp"

// What differs between the FPGA images of the Arm MPS2 board. Addresses and interrupts: Arm application notes AN385,
// AN386 and AN500 (sections "Memory map", "Interrupt map") and AN505 for the Cortex-M33 in its secure state.

namespace fxdyn::hal::mps2 {

#ifdef FXDYN_MPS2_AN505
inline constexpr Address uart0_address = 0x5020'0000, timer0_address = 0x5000'0000, gpio0_address = 0x5010'0000,
                         fpgaio_address = 0x5030'2000;
inline constexpr std::uint32_t uart0_receive_interrupt = 32, timer0_interrupt = 3;
inline constexpr std::uint32_t clock_hz = 20'000'000;
#else
inline constexpr Address uart0_address = 0x4000'4000, timer0_address = 0x4000'0000, gpio0_address = 0x4001'0000,
                         fpgaio_address = 0x4002'8000;
inline constexpr std::uint32_t uart0_receive_interrupt = 0, timer0_interrupt = 8;
inline constexpr std::uint32_t clock_hz = 25'000'000;
#endif

}  // namespace fxdyn::hal::mps2
