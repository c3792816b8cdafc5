#pragma once

#include "hal/registers.hpp"

// Zynq UltraScale+ MPSoC, real-time processors. Addresses: UG1087, "Zynq UltraScale+ Devices Register Reference".

namespace fxdyn::hal::zynqmp_r5 {

inline constexpr Address can0 = 0xff06'0000, gpio = 0xff0a'0000, ttc0 = 0xff11'0000, swdt = 0xff15'0000;

/// CAN0's reference clock as the first-stage boot loader sets it (CRL_APB.CAN0_REF_CTRL): IOPLL 1000 MHz / 10.
inline constexpr unsigned can_clock_hz = 100'000'000;

}  // namespace fxdyn::hal::zynqmp_r5
