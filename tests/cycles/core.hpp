#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tests/cycles/flash.hpp"
#include "tests/cycles/instruction.hpp"

namespace fxdyn::cycles {

/// An instruction that was executed. Its loads and stores stand apart, since they differ from run to run.
struct Step {
  std::uint32_t address = 0;
  const Instruction* instruction = nullptr;
};
struct Access {
  std::uint32_t step = 0;  ///< of the trace
  std::uint32_t address = 0;
  bool is_load = true;
  bool may_miss = false;  ///< see CoreSetup
};
struct Trace {
  std::vector<Step> steps;
  std::vector<Access> accesses;  ///< in order
  std::uint32_t after = 0;       ///< address of the instruction that follows
};

/// Where the manual gives a range or a "might": which end. `likely` has P = 1, plus 1 if the target is not in the
/// instruction, plus 1 if it is a 32-bit instruction that is not word-aligned.
enum class Ends : std::uint8_t { fastest, likely, slowest };

struct CoreSetup {
  Ends ends = Ends::likely;
  /// Everything comes without waiting and without anybody in the way: the table's "zero wait states".
  bool ideal_memory = false;
  std::uint32_t flash_begin = 0x0800'0000, flash_end = 0x0810'0000;
  /// Code and tables moved by so many bytes: what the linker might have done.
  std::uint32_t moved_by = 0;
  bool misses = false;  ///< every load that may miss misses (Flash::load)
};

/// Cortex-M4 in order: fetch ahead of up to three words, decode, execute (DDI 0439, 1.1 and 3.3).
class Core {
 public:
  Core(const CoreSetup& setup, const FlashSetup& flash) : setup_(setup), flash_(flash) {}

  /// Cycles from the first step's execution to the one of what follows; caches stay as they are.
  Time run(const Trace& trace) { return run(trace.steps, trace.accesses, trace.after); }
  Time run(std::span<const Step> steps, std::span<const Access> accesses, std::uint32_t after);
  void forget_caches() { flash_.forget(); }

 private:
  struct Before {
    bool loads = false;          ///< the next load or store may be one cycle shorter
    std::uint16_t loaded = 0;    ///< .. unless its address comes from here
    std::uint16_t computed = 0;  ///< registers that an instruction without memory wrote
  };

  Time fetch(std::uint32_t address, Time now);
  void fetch_ahead(Time until);
  /// When the instruction can begin, not before `now`.
  Time wait_for(std::uint32_t address, std::uint32_t size, Time now);
  /// The next instruction is somewhere else and begins `penalty` after the branch's cycle, or later.
  void refill(std::uint32_t address, std::uint32_t size, Time branched, Time penalty);
  Time penalty(Kind kind, std::uint32_t target, std::uint32_t target_size) const;
  Time execute(const Step& step, std::span<const Access> accesses, Time now);
  bool is_in_flash(std::uint32_t address) const { return address >= setup_.flash_begin && address < setup_.flash_end; }

  CoreSetup setup_;
  Flash flash_;
  Time now_ = 16;  ///< not 0: what came before has time to have been fetched
  Before before_;

  // What is fetched: words from begin_ to end_, ready_ of each; the next one may be asked for at may_fetch_.
  static constexpr std::uint32_t fetched_words = 3;
  std::uint32_t begin_ = 0, end_ = 0;
  std::vector<Time> ready_;
  Time may_fetch_ = 0;
};

}  // namespace fxdyn::cycles
