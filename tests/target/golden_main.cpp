// Golden replay: the model's torques and saturation counts, bit for bit, on a board without anything else running, or
// on the host. Says how many instructions a tick takes where the board can count them.

#include <algorithm>
#include <cstdint>

#include FXDYN_TABLES_HEADER
#include FXDYN_VECTORS_HEADER

#ifdef __arm__
#include "hal/cortex_m/semihosting.hpp"
#else
#include <cstdio>
#endif
#ifdef FXDYN_COUNTS_INSTRUCTIONS
#include "hal/mps2/systick.hpp"
#elif defined(FXDYN_COUNTS_CYCLES)
#include "hal/cortex_m/core.hpp"
#endif

namespace {

using fxdyn::tables::Model;
namespace golden = fxdyn::golden;

#ifdef __arm__
using fxdyn::hal::semihosting::print;
#else
void print(const char* text) { std::fputs(text, stdout); }
void print(std::uint32_t number) { std::printf("%u", number); }
#endif

void print(const char* name, std::uint32_t number) {
  print(name);
  print(" ");
  print(number);
  print("\n");
}

#ifdef FXDYN_COUNTS_INSTRUCTIONS
using Counter = fxdyn::hal::mps2::ExactSysTick;
#elif defined(FXDYN_COUNTS_CYCLES)
using Counter = fxdyn::hal::cortex_m::CycleCounter;  // what tests/cycles looks for
#else
struct Counter {
  void start() {}
  std::uint32_t stop() { return 0; }
};
#endif

Model::State state;
Model::Setpoints* setpoints;  // made in main(): Eigen's constructors are not constexpr
Model::Torques* torques;
fxdyn::Saturations saturations;

/// A function of its own, so that no part of the tick can leave the measured stretch.
[[gnu::noinline]] void compute(const Model::Parameters& parameters) {
  *torques = Model::tick(parameters, state, *setpoints, saturations);
}

[[gnu::noinline]] void nothing(const Model::Parameters&) { asm volatile(""); }

}  // namespace

int main() {
  static_assert(golden::joints == Model::joints && fxdyn::tables::page.header.crc32 == golden::tables_crc,
                "tables.hpp and vectors.hpp are not of one run of make.sh");
  const Model::Parameters& parameters = fxdyn::as_flashed(fxdyn::tables::parameters);
  static Model::Setpoints in_ram{};
  static Model::Torques out{};
  setpoints = &in_ram;
  torques = &out;
  Counter counter;
  counter.start();
  nothing(parameters);
  const std::uint32_t empty = counter.stop();

  std::uint32_t different = 0, fewest = UINT32_MAX, most = 0;
  std::size_t until_reset = 0;
  const std::int32_t *in = golden::setpoints.data(), *expected = golden::torques.data();
  for (std::size_t tick = 0; tick < golden::ticks; ++tick) {
    if (until_reset == 0) {
      state = {};
      until_reset = golden::ticks_per_run;
    }
    --until_reset;
    for (int joint = 0; joint < static_cast<int>(golden::joints); ++joint) {
      in_ram.q[joint].raw = *in++;
      in_ram.dq[joint].raw = *in++;
      in_ram.ddq[joint].raw = *in++;
    }
    saturations = {};
    counter.start();
    compute(parameters);
    const std::uint32_t instructions = counter.stop() - empty;
    fewest = std::min(fewest, instructions);
    most = std::max(most, instructions);

    bool same = saturations.count == golden::saturations[tick];
    for (const auto torque : out) same &= torque.raw == *expected++;
    if (same) continue;
    if (different == 0) print("first_different_tick", static_cast<std::uint32_t>(tick));
    ++different;
  }

  print("joints", golden::joints);
  print("effects", golden::effects);
  print("bls_nodes", golden::bls_nodes);
  print("ticks", static_cast<std::uint32_t>(golden::ticks));
  print("different_ticks", different);
#ifdef FXDYN_COUNTS_INSTRUCTIONS
  print("fewest_instructions", fewest);
  print("most_instructions", most);
#endif
#ifdef __arm__
  fxdyn::hal::semihosting::exit(different == 0 ? 0 : 1);
#else
  return different == 0 ? 0 : 1;
#endif
}
