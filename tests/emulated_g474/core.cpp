#include "tests/emulated_g474/core.hpp"

#include <algorithm>
#include <cstring>
#include <stdexcept>

namespace fxdyn::emulated {
namespace {

// Where the architecture puts things (DDI 0403, table B3-1).
constexpr Address private_bus = 0xe000'0000, peripherals = 0x4000'0000, ports = 0x4800'0000;
constexpr std::size_t private_bytes = 0x10'0000, peripheral_bytes = 0x3'0000, port_bytes = 0x2000;
constexpr std::uint32_t nothing = UINT32_MAX;
constexpr Address exc_return = 0xffff'ff00;
constexpr Address nowhere = 0x1;  // Unicorn stops there; no instruction has an odd address

void check(uc_err error, const char* what) {
  if (error != UC_ERR_OK) throw std::runtime_error(std::string(what) + ": " + uc_strerror(error));
}

}  // namespace

Core::Core(Surroundings& around, Memory flash, Memory ram)
    : around_(around), flash_(flash), ram_(ram), kinds_(flash.bytes.size() / 2) {
  check(uc_open(UC_ARCH_ARM, static_cast<uc_mode>(UC_MODE_THUMB | UC_MODE_MCLASS), &engine_), "uc_open");
  check(uc_ctl_set_cpu_model(engine_, UC_CPU_ARM_CORTEX_M4), "uc_ctl_set_cpu_model");
  check(uc_mem_map_ptr(engine_, flash_.base, flash_.bytes.size(), UC_PROT_READ | UC_PROT_EXEC, flash_.bytes.data()),
        "flash");
  check(uc_mem_map_ptr(engine_, ram_.base, ram_.bytes.size(), UC_PROT_READ | UC_PROT_WRITE, ram_.bytes.data()), "RAM");
  const std::array<std::pair<Address, std::size_t>, 3> regions{
      {{peripherals, peripheral_bytes}, {ports, port_bytes}, {private_bus, private_bytes}}};
  for (std::size_t i = 0; i < regions.size(); ++i) {
    regions_[i] = {this, regions[i].first};
    check(uc_mmio_map(engine_, regions[i].first, regions[i].second, on_read, &regions_[i], on_write, &regions_[i]),
          "uc_mmio_map");
  }
  uc_hook hook = 0;
  check(uc_hook_add(engine_, &hook, UC_HOOK_CODE, reinterpret_cast<void*>(on_instruction), this, 1, 0), "UC_HOOK_CODE");
  check(uc_hook_add(engine_, &hook, UC_HOOK_INTR, reinterpret_cast<void*>(on_trap), this, 1, 0), "UC_HOOK_INTR");
}

Core::~Core() { uc_close(engine_); }

void Core::watch_flash(Address begin, Address end) {
  if (flash_hook_ != 0) check(uc_hook_del(engine_, flash_hook_), "uc_hook_del");
  flash_hook_ = 0;
  if (begin == end) return;
  check(uc_hook_add(engine_, &flash_hook_, UC_HOOK_MEM_READ, reinterpret_cast<void*>(on_flash_read), this, begin,
                    end - 1),
        "UC_HOOK_MEM_READ");
  translate_anew(flash_.base, flash_.base + flash_.bytes.size());
}

void Core::set_trace(Trace* trace) {
  trace_ = trace;
  if (access_hook_ != 0) check(uc_hook_del(engine_, access_hook_), "uc_hook_del");
  access_hook_ = 0;
  if (trace_ == nullptr) return;
  check(uc_hook_add(engine_, &access_hook_, UC_HOOK_MEM_READ | UC_HOOK_MEM_WRITE, reinterpret_cast<void*>(on_access),
                    this, 1, 0),
        "UC_HOOK_MEM");
  translate_anew(flash_.base, flash_.base + flash_.bytes.size());
}

/// A hook is part of the translation.
void Core::translate_anew(std::uint64_t begin, std::uint64_t end) {
  check(uc_ctl_remove_cache(engine_, begin, end), "uc_ctl_remove_cache");
}

std::uint32_t Core::get(int id) const {
  std::uint32_t value = 0;
  check(uc_reg_read(engine_, id, &value), "uc_reg_read");
  return value;
}
void Core::set(int id, std::uint32_t value) { check(uc_reg_write(engine_, id, &value), "uc_reg_write"); }

std::uint32_t Core::reg(int number) const {
  constexpr std::array<int, 16> ids{UC_ARM_REG_R0,  UC_ARM_REG_R1,  UC_ARM_REG_R2,  UC_ARM_REG_R3,
                                    UC_ARM_REG_R4,  UC_ARM_REG_R5,  UC_ARM_REG_R6,  UC_ARM_REG_R7,
                                    UC_ARM_REG_R8,  UC_ARM_REG_R9,  UC_ARM_REG_R10, UC_ARM_REG_R11,
                                    UC_ARM_REG_R12, UC_ARM_REG_R13, UC_ARM_REG_R14, UC_ARM_REG_R15};
  return get(ids[static_cast<std::size_t>(number)]);
}

std::uint32_t* Core::ram_word(Address address) {
  if (address < ram_.base || address - ram_.base + 4 > ram_.bytes.size() || address % 4 != 0) return nullptr;
  return reinterpret_cast<std::uint32_t*>(ram_.bytes.data() + (address - ram_.base));
}

void Core::reset() {
  enabled_.reset();
  pending_.reset();
  lines_.reset();
  priority_ = {};
  active_.clear();
  nmi_line_ = nmi_pending_ = bus_fault_ = sleeping_ = locked_up_ = reset_asked_ = false;
  vectors_ = flash_.base;  // 0, where the flash is mapped a second time (boot from main memory)
  debug_control_ = counter_control_ = system_control_ = coprocessors_ = 0;
  it_begin_ = it_end_ = 0;
  next_event_ = held_until_ = 0;
  forget_changed_code();
  for (const int id : {UC_ARM_REG_R0, UC_ARM_REG_R1, UC_ARM_REG_R2, UC_ARM_REG_R3, UC_ARM_REG_R4, UC_ARM_REG_R5,
                       UC_ARM_REG_R6, UC_ARM_REG_R7, UC_ARM_REG_R8, UC_ARM_REG_R9, UC_ARM_REG_R10, UC_ARM_REG_R11,
                       UC_ARM_REG_R12, UC_ARM_REG_PRIMASK})
    set(id, 0);
  set(UC_ARM_REG_LR, UINT32_MAX);
  set(UC_ARM_REG_XPSR, 1U << 24);
  std::uint32_t vector[2];
  std::memcpy(vector, flash_.bytes.data(), sizeof vector);
  set(UC_ARM_REG_SP, vector[0]);
  pc_ = vector[1] & ~1U;
  if ((vector[1] & 1U) == 0) fault("the reset vector is no Thumb address");
}

/// What lies elsewhere in the flash now may be code of another image. The rest stays translated: Unicorn never gives
/// memory of translations back, and crashes when it is full.
void Core::forget_changed_code() {
  constexpr std::size_t page = 2048;
  const auto all = flash_.bytes;
  const bool first = translated_.empty();
  for (std::size_t at = 0; !first && at < all.size(); at += page) {
    if (std::memcmp(&all[at], &translated_[at], page) == 0) continue;
    std::fill_n(kinds_.begin() + static_cast<std::ptrdiff_t>(at / 2), page / 2, Kind::unknown);
    translate_anew(flash_.base + at, flash_.base + at + page);
  }
  translated_.assign(all.begin(), all.end());
}

// --- running ---------------------------------------------------------------------------------------------------------

void Core::run_until(Time deadline) {
  while (now_ < deadline && !reset_asked_) {
    if (now_ >= next_event_) next_event_ = around_.happen(now_);
    if (reset_asked_) return;
    if (sleeping_ && (best_pending() != nothing || bus_fault_)) sleeping_ = false;
    if (sleeping_ || locked_up_ || now_ < held_until_) {
      now_ = std::min({next_event_, deadline, now_ < held_until_ ? held_until_ : never});
      continue;
    }
    const std::uint32_t exception = best_pending();
    if (exception != nothing && must_take(exception)) enter(exception);
    if (!locked_up_) execute(deadline);
  }
}

void Core::execute(Time deadline) {
  deadline_ = deadline;
  stop_ = Stop::none;
  trapped_ = false;
  const uc_err error = uc_emu_start(engine_, pc_ | 1U, nowhere, 0, 0);
  pc_ = get(UC_ARM_REG_PC) & ~1U;
  after_execution(error);
}

void Core::after_execution(uc_err error) {
  if (stop_ != Stop::none) {
    // Unicorn keeps the IT state of instructions before; this is never inside an IT block.
    set(UC_ARM_REG_XPSR, get(UC_ARM_REG_XPSR) & ~0x0600'fc00U);
    if (stop_ == Stop::sleep) {
      pc_ += 2;
      sleeping_ = true;
      if (trace_ != nullptr) trace_->sleeps();
    }
    return;
  }
  if (pc_ >= (exc_return & ~0xffU)) return leave(pc_ | 1U);
  if (trapped_) return fault("exception " + std::to_string(trap_) + " of the core");
  fault(error == UC_ERR_OK ? "the core stopped" : uc_strerror(error));
}

void Core::stop(Stop why) {
  stop_ = why;
  uc_emu_stop(engine_);
}

void Core::on_instruction(uc_engine*, std::uint64_t pc, std::uint32_t size, void* self) {
  static_cast<Core*>(self)->before(static_cast<Address>(pc), size);
}

void Core::before(Address pc, std::uint32_t size) {
  if (stop_ != Stop::none) return;
  const bool in_it_block = pc > it_begin_ && pc < it_end_;
  if (!in_it_block) {
    if (now_ >= deadline_ || reset_asked_) return stop(Stop::deadline);
    if (now_ >= next_event_) next_event_ = around_.happen(now_);
    const std::uint32_t exception = best_pending();
    if (bus_fault_ || (exception != nothing && must_take(exception))) return stop(Stop::exception);
  }
  switch (kind_of(pc)) {
    case Kind::sleep:
      return stop(Stop::sleep);
    case Kind::it: {
      it_begin_ = it_end_ = pc;
      it_end_ += 2;
      // The lowest bit that is set in the mask ends the block (A7.7.38).
      for (int left = 4 - __builtin_ctz(halfword(pc) & 0xfU); left > 0; --left)
        it_end_ += halfword(it_end_) >> 11 >= 0b11101 ? 4 : 2;
      break;
    }
    case Kind::floating_point:
      around_.violates("floating-point or coprocessor instruction at " + std::to_string(pc));
      break;
    default:
      break;
  }
  ++instructions_;
  cycles_ += cycles_per_instruction;
  now_ += step_;
  if (trace_ != nullptr) trace_->executes(pc, size);
}

std::uint16_t Core::halfword(Address pc) const {
  const Address at = pc - flash_.base;
  if (at + 2 > flash_.bytes.size()) return 0;
  return static_cast<std::uint16_t>(flash_.bytes[at] | flash_.bytes[at + 1] << 8);
}

Core::Kind Core::kind_of(Address pc) {
  const Address at = pc - flash_.base;
  if (at >= flash_.bytes.size()) return Kind::plain;
  Kind& kind = kinds_[at / 2];
  if (kind == Kind::unknown) kind = decode(pc);
  return kind;
}

Core::Kind Core::decode(Address pc) {
  const std::uint16_t first = halfword(pc);
  if (first == 0xbf30) return Kind::sleep;
  if ((first & 0xff00) == 0xbf00 && (first & 0xf) != 0) return Kind::it;
  if ((first & 0xec00) == 0xec00) return Kind::floating_point;  // coprocessor space (A5.3.18)
  return Kind::plain;
}

void Core::on_trap(uc_engine* engine, std::uint32_t number, void* self) {
  auto& core = *static_cast<Core*>(self);
  core.trapped_ = true;
  core.trap_ = number;
  uc_emu_stop(engine);
}

void Core::on_flash_read(uc_engine*, uc_mem_type, std::uint64_t address, int size, std::int64_t, void* self) {
  auto& core = *static_cast<Core*>(self);
  for (Address at = static_cast<Address>(address) & ~7U; at < address + static_cast<unsigned>(size); at += 8)
    core.around_.reads_flash(at);
}

void Core::on_access(uc_engine*, uc_mem_type type, std::uint64_t address, int size, std::int64_t, void* self) {
  static_cast<Core*>(self)->trace_->accesses(static_cast<Address>(address), static_cast<std::uint32_t>(size),
                                             type == UC_MEM_WRITE);
}

std::uint64_t Core::on_read(uc_engine*, std::uint64_t offset, unsigned size, void* region) {
  const auto& [core, base] = *static_cast<Region*>(region);
  if (size != 4) core->around_.violates("reads a register with another width than 32 bits");
  const auto value = core->read_word(base + static_cast<Address>(offset));
  if (!value) core->fault("reads from where nobody answers: " + std::to_string(base + offset));
  return value.value_or(0);
}

void Core::on_write(uc_engine*, std::uint64_t offset, unsigned size, std::uint64_t value, void* region) {
  const auto& [core, base] = *static_cast<Region*>(region);
  if (size != 4) core->around_.violates("writes a register with another width than 32 bits");
  if (!core->write_word(base + static_cast<Address>(offset), static_cast<std::uint32_t>(value)))
    core->fault("writes to where nobody answers: " + std::to_string(base + offset));
}

// --- exceptions ------------------------------------------------------------------------------------------------------

/// Every fault is a HardFault, since nothing enables the others; within HardFault or NMI it locks the core up.
void Core::fault(const std::string& what) {
  faults_.push_back({what, pc_});
  const bool in_vain = std::any_of(active_.begin(), active_.end(), [](auto n) { return n == nmi || n == hard_fault; });
  if (in_vain)
    locked_up_ = true;
  else
    bus_fault_ = true;
}

void Core::set_line(std::uint32_t interrupt, bool level) {
  lines_[interrupt] = level;
  const bool is_active = std::find(active_.begin(), active_.end(), first_interrupt + interrupt) != active_.end();
  if (level && !is_active) pending_[interrupt] = true;
}

void Core::set_nmi(bool level) {
  nmi_line_ = level;
  if (level && std::find(active_.begin(), active_.end(), nmi) == active_.end()) nmi_pending_ = true;
}

int Core::priority(std::uint32_t exception) const {
  if (exception == nmi) return -2;
  if (exception == hard_fault) return -1;
  return priority_[exception - first_interrupt];
}

int Core::current_priority() const {
  int lowest = 256;
  for (const std::uint32_t exception : active_) lowest = std::min(lowest, priority(exception));
  return lowest;
}

std::uint32_t Core::best_pending() const {
  if (nmi_pending_) return nmi;
  if (bus_fault_) return hard_fault;
  const auto ready = pending_ & enabled_;
  if (ready.none()) return nothing;
  std::uint32_t best = nothing;
  for (std::uint32_t i = 0; i < interrupts; ++i)
    if (ready[i] && (best == nothing || priority_[i] < priority_[best - first_interrupt])) best = first_interrupt + i;
  return best;
}

bool Core::must_take(std::uint32_t exception) const {
  const int its = priority(exception);
  if (its >= current_priority()) return false;
  return its < 0 || get(UC_ARM_REG_PRIMASK) == 0;
}

void Core::enter(std::uint32_t exception) {
  if (exception == nmi)
    nmi_pending_ = false;
  else if (exception == hard_fault)
    bus_fault_ = false;
  else
    pending_[exception - first_interrupt] = false;
  const Address before = get(UC_ARM_REG_SP), frame = (before - 32) & ~7U;  // CCR.STKALIGN
  const std::array<int, 6> saved{UC_ARM_REG_R0, UC_ARM_REG_R1,  UC_ARM_REG_R2,
                                 UC_ARM_REG_R3, UC_ARM_REG_R12, UC_ARM_REG_LR};
  std::uint32_t* words = ram_word(frame);
  const std::uint32_t* last = ram_word(frame + 28);
  std::uint32_t handler = 0;
  std::memcpy(&handler, flash_.bytes.data() + (vectors_ - flash_.base) + 4 * exception, 4);
  taken_.push_back(exception);
  if (words == nullptr || last == nullptr || (handler & 1U) == 0) {
    faults_.push_back({"an exception finds no stack or no handler", pc_});
    locked_up_ = true;
    return;
  }
  for (std::size_t i = 0; i < saved.size(); ++i) words[i] = get(saved[i]);
  words[6] = pc_;
  const std::uint32_t status = get(UC_ARM_REG_XPSR);
  words[7] = (status & ~0x0600'fc00U & ~0x1ffU) | (before % 8 != 0 ? 1U << 9 : 0) | 1U << 24 |
             (active_.empty() ? 0 : active_.back());
  set(UC_ARM_REG_LR, active_.empty() ? 0xffff'fff9U : 0xffff'fff1U);
  set(UC_ARM_REG_SP, frame);
  active_.push_back(exception);
  pc_ = handler & ~1U;
  if (trace_ != nullptr) trace_->enters(exception);
}

void Core::leave(Address how) {
  const Address frame = get(UC_ARM_REG_SP);
  const std::uint32_t* words = ram_word(frame);
  const std::uint32_t expected = active_.size() == 1 ? 0xffff'fff9U : 0xffff'fff1U;
  if (active_.empty() || words == nullptr || ram_word(frame + 28) == nullptr || how != expected)
    return fault("no return from an exception");
  const std::array<int, 6> saved{UC_ARM_REG_R0, UC_ARM_REG_R1,  UC_ARM_REG_R2,
                                 UC_ARM_REG_R3, UC_ARM_REG_R12, UC_ARM_REG_LR};
  for (std::size_t i = 0; i < saved.size(); ++i) set(saved[i], words[i]);
  pc_ = words[6] & ~1U;
  set(UC_ARM_REG_XPSR, words[7] & ~0x0600'fc00U & ~0x3ffU);
  set(UC_ARM_REG_SP, frame + 32 + ((words[7] & 1U << 9) != 0 ? 4 : 0));
  const std::uint32_t exception = active_.back();
  active_.pop_back();
  // What still asks is pending again (B3.4.1).
  if (exception == nmi && nmi_line_) nmi_pending_ = true;
  if (exception >= first_interrupt && lines_[exception - first_interrupt]) pending_[exception - first_interrupt] = true;
  if (trace_ != nullptr) trace_->returns();
}

// --- registers -------------------------------------------------------------------------------------------------------

std::optional<std::uint32_t> Core::read_word(Address address) {
  return address >= private_bus ? read_own(address) : around_.read(address);
}
bool Core::write_word(Address address, std::uint32_t value) {
  return address >= private_bus ? write_own(address, value) : around_.write(address, value);
}

std::optional<std::uint32_t> Core::read_own(Address address) {
  const auto bits = [&](const std::bitset<interrupts>& set, Address base) {
    std::uint32_t word = 0;
    for (std::uint32_t i = 0, at = 8 * (address - base); i < 32 && at + i < interrupts; ++i)
      word |= (set[at + i] ? 1U : 0U) << i;
    return word;
  };
  switch (address) {
    case 0xe000'1000:  // DWT_CTRL
      return 0x4000'0000U | counter_control_;
    case 0xe000'1004:  // DWT_CYCCNT: not while the processor sleeps
      return static_cast<std::uint32_t>((counter_control_ != 0 ? cycles_ : 0) - counter_base_);
    case 0xe000'ed00:  // CPUID: r0p1
      return 0x410f'c241;
    case 0xe000'ed04:  // ICSR: VECTACTIVE
      return active_.empty() ? 0 : active_.back();
    case 0xe000'ed08:
      return vectors_;
    case 0xe000'ed0c:
      return 0xfa05'0000;
    case 0xe000'ed10:
      return system_control_;
    case 0xe000'ed14:  // CCR: STKALIGN
      return 0x200;
    case 0xe000'ed88:
      return coprocessors_;
    case 0xe000'edfc:
      return debug_control_;
    default:
      break;
  }
  if (address >= 0xe000'e100 && address < 0xe000'e110) return bits(enabled_, 0xe000'e100);
  if (address >= 0xe000'e180 && address < 0xe000'e190) return bits(enabled_, 0xe000'e180);
  if (address >= 0xe000'e200 && address < 0xe000'e210) return bits(pending_, 0xe000'e200);
  if (address >= 0xe000'e280 && address < 0xe000'e290) return bits(pending_, 0xe000'e280);
  if (address >= 0xe000'e400 && address < 0xe000'e400 + interrupts) {
    std::uint32_t word = 0;
    for (std::uint32_t i = 0; i < 4 && address - 0xe000'e400 + i < interrupts; ++i)
      word |= std::uint32_t{priority_[address - 0xe000'e400 + i]} << 8 * i;
    return word;
  }
  return std::nullopt;
}

bool Core::write_own(Address address, std::uint32_t value) {
  const auto change = [&](std::bitset<interrupts>& set, Address base, bool to) {
    for (std::uint32_t i = 0, at = 8 * (address - base); i < 32; ++i) {
      if ((value >> i & 1U) == 0) continue;
      if (at + i < interrupts)
        set[at + i] = to;
      else
        around_.violates("an interrupt that the part does not have");
    }
    return true;
  };
  switch (address) {
    case 0xe000'1000:
      if ((debug_control_ >> 24 & 1U) == 0) around_.violates("DWT without TRCENA");
      if ((value & 1U) != counter_control_) counter_base_ += counter_control_ == 0 ? cycles_ : 0 - cycles_;
      counter_control_ = value & 1U;
      return true;
    case 0xe000'1004:
      if ((debug_control_ >> 24 & 1U) == 0) around_.violates("DWT without TRCENA");
      counter_base_ = (counter_control_ != 0 ? cycles_ : 0) - value;
      return true;
    case 0xe000'ed04:  // ICSR: NMIPENDSET
      if ((value >> 31 & 1U) != 0) nmi_pending_ = true;
      return true;
    case 0xe000'ed08:
      vectors_ = value;
      return vectors_ >= flash_.base && vectors_ < flash_.base + flash_.bytes.size();
    case 0xe000'ed0c:
      if (value >> 16 != 0x05fa) around_.violates("AIRCR without its key");
      if (value >> 16 == 0x05fa && (value >> 2 & 1U) != 0) reset_asked_ = true;
      return true;
    case 0xe000'ed10:
      system_control_ = value;
      return true;
    case 0xe000'ed88:
      coprocessors_ = value;
      return true;
    case 0xe000'edfc:
      debug_control_ = value;
      return true;
    default:
      break;
  }
  if (address >= 0xe000'e100 && address < 0xe000'e110) return change(enabled_, 0xe000'e100, true);
  if (address >= 0xe000'e180 && address < 0xe000'e190) return change(enabled_, 0xe000'e180, false);
  if (address >= 0xe000'e200 && address < 0xe000'e210) return change(pending_, 0xe000'e200, true);
  if (address >= 0xe000'e280 && address < 0xe000'e290) return change(pending_, 0xe000'e280, false);
  if (address >= 0xe000'e400 && address < 0xe000'e400 + interrupts) {
    for (std::uint32_t i = 0; i < 4 && address - 0xe000'e400 + i < interrupts; ++i)
      priority_[address - 0xe000'e400 + i] = static_cast<std::uint8_t>(value >> 8 * i) & 0xf0U;  // four bits
    return true;
  }
  return false;
}

}  // namespace fxdyn::emulated
