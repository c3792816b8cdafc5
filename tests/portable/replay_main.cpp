// The example drive's own code on the golden setpoints: says whether it takes its tables, and a checksum of its
// torques.

#define main drive_main
#include "firmware/example_drive/main.cpp"
#undef main

#include "vectors.hpp"

#ifdef __arm__
#include "hal/cortex_m/semihosting.hpp"
using fxdyn::hal::semihosting::print;
[[noreturn]] int end() { fxdyn::hal::semihosting::exit(0); }
#else
#include <cstdio>
int end() { return 0; }
void print(const char* text) { std::fputs(text, stdout); }
void print(std::uint32_t number) { std::printf("%u", number); }
#endif

namespace {

namespace golden = fxdyn::golden;

/// CRC-32 of the torques that the drive's control loop gets.
std::uint32_t replay() {
  static_assert(golden::joints == Model::joints && golden::joints == Model::outputs);
  fxdyn::Crc32 torques;
  const std::int32_t* in = golden::setpoints.data();
  for (std::size_t tick = 0; tick < golden::ticks; ++tick) {
    if (tick % golden::ticks_per_run == 0) state = {};
    for (volatile std::int32_t& setpoint : bus_setpoints) setpoint = *in++;
    on_tick();
    for (const volatile std::int32_t& torque : torque_offset) torques.add(static_cast<std::uint32_t>(torque));
  }
  return torques.value();
}

bool any_torque() {
  for (const volatile std::int32_t& torque : torque_offset) {
    if (torque != 0) return true;
  }
  return false;
}

}  // namespace

int main() {
  const bool runs = drive_main() == 0;
  if (runs && fault == Fault::none) {
    print("torques ");
    print(replay());
    print("\n");
  } else {
    print(!runs && fault == Fault::tables && !any_torque() ? "refused, no torque\n" : "neither runs nor refuses\n");
  }
  return end();
}
