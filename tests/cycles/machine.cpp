#include "tests/cycles/machine.hpp"

#include <elf.h>

#include <array>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <utility>

namespace fxdyn::cycles {
namespace {

void check(uc_err error) {
  if (error != UC_ERR_OK) throw std::runtime_error(uc_strerror(error));
}

constexpr std::uint32_t peripherals_begin = 0x4000'0000, peripherals_bytes = 0x2000'0000;
constexpr std::uint32_t system_begin = 0xe000'0000, system_bytes = 0x10'0000;
constexpr std::uint16_t breakpoint = 0xbe00, breakpoint_mask = 0xff00;

bool is_branch(const Instruction& instruction) {
  return instruction.kind == Kind::branch || instruction.kind == Kind::branch_to_register ||
         instruction.kind == Kind::load_pc;
}
std::uint32_t after(const Step& step) { return step.address + step.instruction->size; }

}  // namespace

Machine::Machine() : quick_(flash_bytes / 2) {
  uc_engine* engine = nullptr;
  check(uc_open(UC_ARCH_ARM, static_cast<uc_mode>(UC_MODE_THUMB | UC_MODE_MCLASS), &engine));
  engine_.reset(engine);
  check(uc_ctl_set_cpu_model(engine, UC_CPU_ARM_CORTEX_M4));
  check(uc_mem_map(engine, flash_begin, flash_bytes, UC_PROT_ALL));
  check(uc_mem_map(engine, ram_begin, ram_bytes, UC_PROT_ALL));
  check(uc_mem_map(engine, peripherals_begin, peripherals_bytes, UC_PROT_READ | UC_PROT_WRITE));
  check(uc_mem_map(engine, system_begin, system_bytes, UC_PROT_READ | UC_PROT_WRITE));
  uc_hook hook = 0;
  const uc_cb_hookcode_t code = [](uc_engine*, std::uint64_t address, std::uint32_t, void* self) {
    auto& machine = *static_cast<Machine*>(self);
    machine.guard([&] { machine.on_code(static_cast<std::uint32_t>(address)); });
  };
  const uc_cb_hookmem_t memory = [](uc_engine*, uc_mem_type type, std::uint64_t address, int, std::int64_t,
                                    void* self) {
    auto& machine = *static_cast<Machine*>(self);
    machine.guard([&] { machine.on_memory(type == UC_MEM_READ, static_cast<std::uint32_t>(address)); });
  };
  check(uc_hook_add(engine, &hook, UC_HOOK_CODE, reinterpret_cast<void*>(code), this, 1, 0));
  check(uc_hook_add(engine, &hook, UC_HOOK_MEM_READ | UC_HOOK_MEM_WRITE, reinterpret_cast<void*>(memory), this, 1, 0));
}

void Machine::write(std::uint32_t address, std::span<const std::byte> bytes) {
  check(uc_mem_write(engine_.get(), address, bytes.data(), bytes.size()));
}

std::uint32_t Machine::read_word(std::uint32_t address) {
  std::uint32_t word = 0;
  check(uc_mem_read(engine_.get(), address, &word, sizeof word));
  return word;
}

void Machine::set_register(int number, std::uint32_t value) {
  check(uc_reg_write(engine_.get(),
                     number == 13   ? UC_ARM_REG_SP
                     : number == 14 ? UC_ARM_REG_LR
                                    : UC_ARM_REG_R0 + number,
                     &value));
}

std::uint32_t Machine::get_register(int number) {
  std::uint32_t value = 0;
  check(uc_reg_read(engine_.get(), UC_ARM_REG_R0 + number, &value));
  return value;
}

Machine::Stop Machine::run(std::uint32_t until, std::uint64_t most_instructions) {
  if (at_breakpoint_) pc_ += 2;
  at_breakpoint_ = false;
  const uc_err error = uc_emu_start(engine_.get(), pc_ | 1, until, 0, most_instructions);
  if (thrown_) std::rethrow_exception(std::exchange(thrown_, {}));
  check(error);
  if (at_breakpoint_) return Stop::breakpoint;
  check(uc_reg_read(engine_.get(), UC_ARM_REG_PC, &pc_));
  return (pc_ & ~1U) == (until & ~1U) ? Stop::address : Stop::limit;
}

std::string Machine::text_at(std::uint32_t address) {
  std::string text;
  for (char c = 0;; text += c) {
    check(uc_mem_read(engine_.get(), address++, &c, 1));
    if (c == 0) return text;
  }
}

const Instruction& Machine::instruction_at(std::uint32_t address) {
  const bool in_flash = address - flash_begin < flash_bytes;
  if (in_flash && quick_[(address - flash_begin) / 2] != nullptr) return *quick_[(address - flash_begin) / 2];
  const auto [place, is_new] = decoded_.try_emplace(address);
  if (is_new) {
    std::array<std::byte, 4> code{};
    check(uc_mem_read(engine_.get(), address, code.data(), code.size()));
    place->second = decoder_.decode(address, code);
  }
  if (in_flash) quick_[(address - flash_begin) / 2] = &place->second;
  return place->second;
}

void Machine::record(std::uint32_t address) {
  auto& steps = trace_.steps;
  if (!steps.empty() && !is_branch(*steps.back().instruction)) {
    // Unicorn does not tell instructions whose condition is not met; they take their time all the same.
    for (std::uint32_t skipped = after(steps.back()); skipped < address; skipped = after(steps.back()))
      steps.push_back({skipped, &instruction_at(skipped)});
  }
  trace_.after = address;
}

Trace Machine::end() {
  recording_ = false;
  if (at_breakpoint_)
    record(pc_);
  else
    trace_.after = after(trace_.steps.back());
  return std::move(trace_);
}

void Machine::on_code(std::uint32_t address) {
  pc_ = address;
  std::uint16_t code = 0;
  check(uc_mem_read(engine_.get(), address, &code, sizeof code));
  if ((code & breakpoint_mask) == breakpoint) {
    at_breakpoint_ = true;
    check(uc_emu_stop(engine_.get()));
    return;
  }
  if (!recording_) return;
  record(address);
  trace_.steps.push_back({address, &instruction_at(address)});
}

void Machine::on_memory(bool is_load, std::uint32_t address) {
  if (recording_ && !trace_.steps.empty())
    trace_.accesses.push_back({static_cast<std::uint32_t>(trace_.steps.size() - 1), address, is_load});
  if (is_load && address == marker_ && told_) told_();
}

Elf Elf::read(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> all{std::istreambuf_iterator<char>(file), {}};
  const auto at = [&]<typename T>(std::size_t offset, T&& into) {
    if (offset + sizeof into > all.size()) throw std::runtime_error(path + ": not a whole ELF file");
    std::memcpy(&into, all.data() + offset, sizeof into);
  };
  Elf elf;
  Elf32_Ehdr header{};
  at(0, header);
  if (std::memcmp(header.e_ident, ELFMAG, SELFMAG) != 0 || header.e_machine != EM_ARM)
    throw std::runtime_error(path + ": not an Arm ELF file");
  const auto section = [&](unsigned index) {
    Elf32_Shdr said{};
    at(header.e_shoff + index * header.e_shentsize, said);
    return said;
  };
  // What a flash programmer writes: by segment, at the load address.
  for (unsigned i = 0; i < header.e_phnum; ++i) {
    Elf32_Phdr segment{};
    at(header.e_phoff + i * header.e_phentsize, segment);
    if (segment.p_type != PT_LOAD || segment.p_filesz == 0) continue;
    Section made{segment.p_paddr, std::vector<std::byte>(segment.p_filesz)};
    if (segment.p_offset + segment.p_filesz > all.size()) throw std::runtime_error(path + ": not a whole ELF file");
    std::memcpy(made.bytes.data(), all.data() + segment.p_offset, segment.p_filesz);
    elf.sections.push_back(std::move(made));
  }
  for (unsigned i = 0; i < header.e_shnum; ++i) {
    const Elf32_Shdr symbols = section(i);
    if (symbols.sh_type != SHT_SYMTAB) continue;
    const Elf32_Shdr names = section(symbols.sh_link);
    for (std::size_t k = 0; k < symbols.sh_size / sizeof(Elf32_Sym); ++k) {
      Elf32_Sym symbol{};
      at(symbols.sh_offset + k * sizeof symbol, symbol);
      elf.symbols[all.data() + names.sh_offset + symbol.st_name] = symbol.st_value;
    }
  }
  return elf;
}

}  // namespace fxdyn::cycles
