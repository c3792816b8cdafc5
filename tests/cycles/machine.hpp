#pragma once

#include <unicorn/unicorn.h>

#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "tests/cycles/core.hpp"

namespace fxdyn::cycles {

/// A Cortex-M4 with the STM32G4's memories, run by Unicorn: what is executed and which addresses it touches. No
/// peripherals: their addresses are plain memory.
class Machine {
 public:
  Machine();
  void write(std::uint32_t address, std::span<const std::byte> bytes);
  std::uint32_t read_word(std::uint32_t address);
  void set_register(int number, std::uint32_t value);
  std::uint32_t get_register(int number);
  void set_pc(std::uint32_t address) { pc_ = address; }

  enum class Stop : std::uint8_t { breakpoint, address, limit };
  /// Runs on until a BKPT, which is not executed and which the next run() skips, or until `address`.
  Stop run(std::uint32_t until = 0xffff'fffe, std::uint64_t most_instructions = 100'000'000);
  std::string text_at(std::uint32_t address);

  /// What is executed between the two: called while stopped, or from what on_load() tells, where the load that is told
  /// is the last step before and the last one of the trace.
  void begin() {
    trace_ = {};
    recording_ = true;
  }
  Trace end();
  /// `told` at every load from `marker`.
  void on_load(std::uint32_t marker, std::function<void()> told) {
    marker_ = marker;
    told_ = std::move(told);
  }
  const Instruction& instruction_at(std::uint32_t address);

 private:
  struct Closer {
    void operator()(uc_struct* engine) const { uc_close(engine); }
  };
  void record(std::uint32_t address);
  void on_code(std::uint32_t address);
  void on_memory(bool is_load, std::uint32_t address);
  /// Unicorn is C: what is thrown in what it calls is kept and run() throws it.
  template <typename Work>
  void guard(Work work) {
    try {
      if (!thrown_) work();
    } catch (...) {
      thrown_ = std::current_exception();
      uc_emu_stop(engine_.get());
    }
  }

  std::unique_ptr<uc_struct, Closer> engine_;
  Decoder decoder_;
  std::map<std::uint32_t, Instruction> decoded_;
  std::vector<const Instruction*> quick_;  ///< of the flash, a place each half-word
  Trace trace_;
  bool recording_ = false, at_breakpoint_ = false;
  std::uint32_t pc_ = 0, marker_ = 0;
  std::function<void()> told_;
  std::exception_ptr thrown_;
};

inline constexpr std::uint32_t flash_begin = 0x0800'0000, flash_bytes = 0x8'0000;
inline constexpr std::uint32_t ram_begin = 0x2000'0000, ram_bytes = 0x2'0000;

/// Sections of a 32-bit Arm ELF that belong into memory, and its symbols.
struct Elf {
  struct Section {
    std::uint32_t address = 0;
    std::vector<std::byte> bytes;
  };
  std::vector<Section> sections;
  std::map<std::string, std::uint32_t> symbols;

  static Elf read(const std::string& path);
};

}  // namespace fxdyn::cycles
