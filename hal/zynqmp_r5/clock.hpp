#pragma once

#include <cstdint>

#include "hal/clock.hpp"
#include "hal/polled.hpp"
#include "hal/zynqmp_r5/board.hpp"

namespace fxdyn::hal::zynqmp_r5 {

/// Triple timer counter 0, counter 1 (UG1087, module TTC), clocked with 100 MHz / 64 (LPD_LSBUS, UG1085 "Clocking") and
/// read as 16 bits: what the Zynq-7000 and QEMU's model have of it, where the UltraScale+ has 32. It has to be read
/// every 42 ms.
template <Registers R = MemoryMapped>
class BasicMicrosecondClock {
 public:
  explicit BasicMicrosecondClock(R registers = {}) : registers_(registers) {
    registers_.write(ttc0 + 0x0c, 1U << 0);            // counter control: off
    registers_.write(ttc0 + 0x00, 5U << 1 | 1U << 0);  // clock control: prescaler on, 2^(5 + 1)
    registers_.write(ttc0 + 0x24, 0xffff);             // interval
    registers_.write(ttc0 + 0x0c, 1U << 4 | 1U << 1);  // reset the count, run over the interval
  }
  std::uint32_t now_us() { return time_.now(registers_.read(ttc0 + 0x18) & 0xffff); }

 private:
  using Time = Microseconds<16>;
  [[no_unique_address]] R registers_;
  Time time_{Time::Rate{100'000'000 / 64}};
};
using MicrosecondClock = BasicMicrosecondClock<>;
static_assert(Clock<MicrosecondClock>);
using Timer = PolledTimer<MicrosecondClock>;  ///< the node of this board polls: nothing needs to wake it
static_assert(TickTimer<Timer>);

#ifdef __arm__
/// The performance monitor's cycle counter (Armv7-R Architecture Reference Manual, DDI 0406, "Performance Monitors":
/// PMCR, PMCNTENSET, PMCCNTR). No interrupt is in use on this board.
class CycleCounter {
 public:
  CycleCounter() {
    asm volatile("mcr p15, 0, %0, c9, c12, 0" ::"r"(0b101));     // PMCR: E, C; no divider
    asm volatile("mcr p15, 0, %0, c9, c12, 1" ::"r"(1U << 31));  // PMCNTENSET: C
  }
  void start() { begin_ = read(); }
  std::uint32_t stop() { return read() - begin_; }
  static constexpr const char* unit() { return "cycles"; }

 private:
  static std::uint32_t read() {
    std::uint32_t count;
    asm volatile("mrc p15, 0, %0, c9, c13, 0" : "=r"(count)::"memory");
    return count;
  }
  std::uint32_t begin_ = 0;
};
static_assert(hal::CycleCounter<CycleCounter>);
#endif

}  // namespace fxdyn::hal::zynqmp_r5
