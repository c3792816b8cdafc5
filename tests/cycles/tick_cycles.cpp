// tick_cycles GOLDEN.elf: cycles of the model's tick in a golden image of the STM32G474 (tests/target/golden_main.cpp),
// a line a set-up. The image itself compares its torques bit for bit; what lies between its two looks at the cycle
// counter, as the drive node has them for object 0x2002:1, is the tick.

#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/cycles/core.hpp"
#include "tests/cycles/machine.hpp"

namespace fxdyn::cycles {
namespace {

// Armv7-M Architecture Reference Manual (DDI 0403), C1.6.5 and C1.8
constexpr std::uint32_t cycle_counter = 0xe000'1004;                                     // DWT_CYCCNT
constexpr std::uint32_t counter_control = 0xe000'1000, counts_cycles = 1U << 0;          // DWT_CTRL: CYCCNTENA
constexpr std::uint32_t debug_control = 0xe000'edfc, trace_and_debug_blocks = 1U << 24;  // DEMCR: TRCENA

/// Ticks that execute the same instructions, so that they differ in nothing but data and addresses of data.
struct Ticks {
  std::vector<Step> steps;
  std::uint32_t after = 0;
  std::vector<std::vector<Access>> accesses;  ///< of each
  std::size_t instructions = 0;               ///< without those of a measurement of nothing

  void add(Trace trace) {
    if (accesses.empty()) {
      steps = std::move(trace.steps);
      after = trace.after;
    } else if (!std::equal(steps.begin(), steps.end(), trace.steps.begin(), trace.steps.end(),
                           [](const Step& a, const Step& b) { return a.address == b.address; })) {
      throw std::runtime_error("ticks take different paths");
    }
    accesses.push_back(std::move(trace.accesses));
  }
};

/// Executes the image up to its end; throws unless its torques are the golden ones.
Ticks run(const Elf& elf, Machine& machine) {
  for (const Elf::Section& section : elf.sections) machine.write(section.address, section.bytes);
  machine.set_register(13, machine.read_word(flash_begin));
  machine.set_pc(machine.read_word(flash_begin + 4) & ~1U);

  Ticks ticks;
  bool is_measuring = false;
  std::size_t of_nothing = 0;
  machine.on_load(cycle_counter, [&] {
    if ((machine.read_word(debug_control) & trace_and_debug_blocks) == 0 ||
        (machine.read_word(counter_control) & counts_cycles) == 0)
      throw std::runtime_error("the cycle counter stands still");
    is_measuring = !is_measuring;
    if (is_measuring) return machine.begin();
    Trace trace = machine.end();
    if (of_nothing == 0)
      of_nothing = trace.steps.size();
    else
      ticks.add(std::move(trace));
  });
  constexpr std::uint32_t write0 = 0x04, exit_extended = 0x20;  // semihosting calls
  while (machine.run() == Machine::Stop::breakpoint) {
    const std::uint32_t call = machine.get_register(0), argument = machine.get_register(1);
    if (call == write0) std::cerr << machine.text_at(argument);
    if (call != exit_extended) continue;
    if (machine.read_word(argument + 4) != 0) throw std::runtime_error("the image's torques are not the golden ones");
    if (ticks.accesses.empty()) throw std::runtime_error("the image does not look at the cycle counter");
    ticks.instructions = ticks.steps.size() - of_nothing;
    return ticks;
  }
  throw std::runtime_error("the image does not end");
}

bool is_table(const Access& access) {
  return access.is_load && access.address >= flash_begin && access.address < flash_begin + flash_bytes;
}

/// Marks the loads from the flash whose address is not the same in every tick. Returns how many.
std::size_t mark_data_dependent(Ticks& ticks) {
  const std::vector<Access>& first = ticks.accesses[0];
  for (const std::vector<Access>& one : ticks.accesses)
    if (!std::equal(first.begin(), first.end(), one.begin(), one.end(),
                    [](const Access& a, const Access& b) { return a.step == b.step && a.is_load == b.is_load; }))
      throw std::runtime_error("ticks have different loads and stores");
  std::size_t marked = 0;
  for (std::size_t i = 0; i < first.size(); ++i) {
    const bool differs = std::any_of(ticks.accesses.begin(), ticks.accesses.end(),
                                     [&](const auto& one) { return one[i].address != first[i].address; });
    if (!differs || !is_table(first[i])) continue;
    ++marked;
    for (std::vector<Access>& one : ticks.accesses) one[i].may_miss = true;
  }
  return marked;
}

struct Configuration {
  const char* name;
  FlashSetup flash{};
  bool is_ideal = false, is_cold = false, misses = false;
};

/// The most of every `stride`th tick, in a row.
Time most(const Ticks& ticks, std::size_t stride, const Configuration& configuration, const CoreSetup& setup) {
  Core core(setup, configuration.flash);
  core.run(ticks.steps, ticks.accesses[0], ticks.after);  // what "warm" begins with
  Time found = 0;
  for (std::size_t i = 0; i < ticks.accesses.size(); i += stride) {
    if (configuration.is_cold) core.forget_caches();
    found = std::max(found, core.run(ticks.steps, ticks.accesses[i], ticks.after));
  }
  return found;
}

/// The most over all ticks, and over some of them wherever the linker may have put code and tables.
Time worst(const Ticks& ticks, const Configuration& configuration, Ends ends) {
  constexpr std::size_t some = 8;
  CoreSetup setup{.ends = ends, .ideal_memory = configuration.is_ideal, .misses = configuration.misses};
  Time found = most(ticks, 1, configuration, setup);
  if (configuration.is_ideal) return found;
  for (setup.moved_by = 4; setup.moved_by < LineCache::line_bytes; setup.moved_by += 4)
    found = std::max(found, most(ticks, some, configuration, setup));
  return found;
}

constexpr FlashSetup at_170_mhz(bool caches, Prefetch prefetch, std::uint32_t width = 8) {
  return {.wait_states = 4, .width = width, .prefetch = prefetch, .caches = caches};
}

void print_cycles(const char* path) {
  Machine machine;
  Ticks ticks = run(Elf::read(path), machine);
  const std::size_t data_dependent = mark_data_dependent(ticks);
  const auto tables = std::count_if(ticks.accesses[0].begin(), ticks.accesses[0].end(), is_table);
  std::printf("ticks %zu\ninstructions %zu\nloads_from_flash %td\ndata_dependent_loads %zu\n", ticks.accesses.size(),
              ticks.instructions, tables, data_dependent);

  const std::array configurations{
      Configuration{.name = "no_wait_states", .is_ideal = true},
      Configuration{.name = "caches_warm", .flash = at_170_mhz(true, Prefetch::off)},
      Configuration{.name = "caches", .flash = at_170_mhz(true, Prefetch::off), .is_cold = true, .misses = true},
      Configuration{
          .name = "prefetch_copied", .flash = at_170_mhz(true, Prefetch::copied), .is_cold = true, .misses = true},
      Configuration{.name = "prefetch_copied_if_late",
                    .flash = at_170_mhz(true, Prefetch::copied_if_late),
                    .is_cold = true,
                    .misses = true},
      Configuration{
          .name = "prefetch_apart", .flash = at_170_mhz(true, Prefetch::apart), .is_cold = true, .misses = true},
      Configuration{.name = "prefetch_apart_after_hits",
                    .flash = at_170_mhz(true, Prefetch::apart_after_hits),
                    .is_cold = true,
                    .misses = true},
      Configuration{
          .name = "single_bank", .flash = at_170_mhz(true, Prefetch::off, 16), .is_cold = true, .misses = true},
      Configuration{.name = "no_caches", .flash = at_170_mhz(false, Prefetch::off), .is_cold = true, .misses = true},
  };
  for (const Configuration& configuration : configurations) {
    std::printf("%s", configuration.name);
    for (const Ends ends : {Ends::fastest, Ends::likely, Ends::slowest})
      std::printf(" %llu", static_cast<unsigned long long>(worst(ticks, configuration, ends)));
    std::printf("\n");
  }
}

}  // namespace
}  // namespace fxdyn::cycles

int main(int count, char** arguments) {
  if (count != 2) {
    std::cerr << "usage: tick_cycles GOLDEN.elf\n";
    return 2;
  }
  try {
    fxdyn::cycles::print_cycles(arguments[1]);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "tick_cycles: " << error.what() << "\n";
    return 1;
  }
}
