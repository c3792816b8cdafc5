#pragma once

#include <unicorn/unicorn.h>

#include <array>
#include <bitset>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tests/emulated_g474/time.hpp"

namespace fxdyn::emulated {

using Address = std::uint32_t;

/// What lies around the processor.
class Surroundings {
 public:
  virtual ~Surroundings() = default;
  /// A word of the peripherals' address space; nothing where nobody answers, which is a bus fault.
  virtual std::optional<std::uint32_t> read(Address address) = 0;
  virtual bool write(Address address, std::uint32_t value) = 0;
  /// Data is read from the part of the flash that watch_flash() named.
  virtual void reads_flash(Address address) = 0;
  /// Does what is due and says when something is due next.
  virtual Time happen(Time now) = 0;
  virtual void violates(const std::string& what) = 0;
};

/// Notes what the processor does, for whoever wants to know where its time goes.
class Trace {
 public:
  virtual ~Trace() = default;
  virtual void executes(Address pc, std::uint32_t size) = 0;
  virtual void accesses(Address address, std::uint32_t size, bool writes) = 0;
  virtual void enters(std::uint32_t exception) = 0;
  virtual void returns() = 0;
  virtual void sleeps() = 0;
};

/// Cortex-M4: Unicorn executes the instructions, and this does what Unicorn lacks: exceptions with their stack frames,
/// NVIC, system control block, cycle counter, sleep, lock-up (Armv7-M Architecture Reference Manual, DDI 0403: B1.5,
/// B3.2, B3.4, C1.8). Not here: SysTick, MPU, FPU, debug; an access to them is a bus fault, a floating-point
/// instruction a violation. An exception is taken between any two instructions, except inside an IT block.
class Core {
 public:
  struct Memory {
    Address base = 0;
    std::span<std::uint8_t> bytes;
  };
  struct Fault {
    std::string what;
    Address pc = 0;
  };
  static constexpr std::uint32_t nmi = 2, hard_fault = 3, first_interrupt = 16, interrupts = 102;

  Core(Surroundings& around, Memory flash, Memory ram);
  ~Core();
  Core(const Core&) = delete;
  Core& operator=(const Core&) = delete;

  void reset();
  /// Runs, sleeps or stays locked up until `deadline`, or until a reset is asked for.
  void run_until(Time deadline);

  Time now() const { return now_; }
  std::uint64_t instructions() const { return instructions_; }
  std::uint64_t cycles() const { return cycles_; }
  /// What a period of the processor's clock takes.
  void set_clock(std::uint64_t hz) { step_ = periods(cycles_per_instruction, hz); }
  /// Asks Surroundings::happen() again before the next instruction.
  void look_again() { next_event_ = 0; }

  void set_line(std::uint32_t interrupt, bool level);
  void set_nmi(bool level);
  void watch_flash(Address begin, Address end);
  void set_trace(Trace* trace);
  void ask_for_reset() { reset_asked_ = true; }
  /// Stands still until then, as on an access that nobody answers.
  void hold_until(Time then) { held_until_ = then; }
  /// Goes on at `address` instead, as code that went astray; interrupts are taken there, too.
  void divert(Address address) { pc_ = address; }

  bool sleeping() const { return sleeping_; }
  bool locked_up() const { return locked_up_; }
  bool reset_asked() const { return reset_asked_; }
  const std::vector<Fault>& faults() const { return faults_; }
  const std::vector<std::uint32_t>& active() const { return active_; }
  /// Exceptions in the order in which they were entered.
  const std::vector<std::uint32_t>& taken() const { return taken_; }
  void forget_taken() { taken_.clear(); }
  std::uint32_t reg(int number) const;  ///< r0 .. r15
  bool is_enabled(std::uint32_t interrupt) const { return enabled_[interrupt]; }
  std::uint32_t priority_of(std::uint32_t interrupt) const { return priority_[interrupt]; }
  /// As a debugger writes the NVIC.
  void enable(std::uint32_t interrupt) { enabled_[interrupt] = true; }
  void pend(std::uint32_t interrupt) { pending_[interrupt] = true; }
  void prioritise(std::uint32_t interrupt, std::uint8_t priority) { priority_[interrupt] = priority; }
  Address pc() const { return pc_; }

  /// Cycles an instruction takes on average: two leave room for flash wait states.
  static constexpr std::uint32_t cycles_per_instruction = 2;

 private:
  enum class Kind : std::uint8_t { unknown, plain, it, sleep, floating_point };
  enum class Stop : std::uint8_t { none, exception, deadline, sleep };

  static void on_instruction(uc_engine*, std::uint64_t pc, std::uint32_t size, void* self);
  static void on_trap(uc_engine*, std::uint32_t number, void* self);
  static void on_flash_read(uc_engine*, uc_mem_type, std::uint64_t address, int size, std::int64_t, void* self);
  static void on_access(uc_engine*, uc_mem_type, std::uint64_t address, int size, std::int64_t, void* self);
  static std::uint64_t on_read(uc_engine*, std::uint64_t offset, unsigned size, void* region);
  static void on_write(uc_engine*, std::uint64_t offset, unsigned size, std::uint64_t value, void* region);

  struct Region {
    Core* core = nullptr;
    Address base = 0;
  };

  void forget_changed_code();
  void translate_anew(std::uint64_t begin, std::uint64_t end);
  void before(Address pc, std::uint32_t size);
  void stop(Stop why);
  Kind kind_of(Address pc);
  Kind decode(Address pc);
  std::uint16_t halfword(Address pc) const;
  void execute(Time deadline);
  void after_execution(uc_err error);
  void fault(const std::string& what);
  std::uint32_t best_pending() const;
  bool must_take(std::uint32_t exception) const;
  int priority(std::uint32_t exception) const;
  int current_priority() const;
  void enter(std::uint32_t exception);
  void leave(Address exc_return);
  std::optional<std::uint32_t> read_word(Address address);
  bool write_word(Address address, std::uint32_t value);
  std::optional<std::uint32_t> read_own(Address address);
  bool write_own(Address address, std::uint32_t value);
  std::uint32_t get(int id) const;
  void set(int id, std::uint32_t value);
  std::uint32_t* ram_word(Address address);

  Surroundings& around_;
  Memory flash_, ram_;
  uc_engine* engine_ = nullptr;
  std::array<Region, 3> regions_;
  uc_hook flash_hook_ = 0, access_hook_ = 0;
  Trace* trace_ = nullptr;

  Time now_ = 0, step_ = 0, next_event_ = 0, deadline_ = 0, held_until_ = 0;
  std::uint64_t instructions_ = 0, cycles_ = 0, counter_base_ = 0;
  Stop stop_ = Stop::none;
  bool bus_fault_ = false, sleeping_ = false, locked_up_ = false, reset_asked_ = false;
  std::uint32_t trap_ = 0;
  bool trapped_ = false;
  Address pc_ = 0, it_begin_ = 0, it_end_ = 0;
  std::vector<Kind> kinds_;
  std::vector<std::uint8_t> translated_;  ///< the flash at the last reset

  std::bitset<interrupts> enabled_, pending_, lines_;
  std::array<std::uint8_t, interrupts> priority_{};
  bool nmi_line_ = false, nmi_pending_ = false;
  std::vector<std::uint32_t> active_, taken_;
  std::vector<Fault> faults_;
  Address vectors_ = 0;
  std::uint32_t debug_control_ = 0, counter_control_ = 0, system_control_ = 0, coprocessors_ = 0;
};

}  // namespace fxdyn::emulated
