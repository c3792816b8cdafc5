// function_cycles IMAGE.elf FUNCTION...: instructions and cycles of single functions, called with addresses of zeros in
// RAM, memory without wait states, without what the return to the caller takes. For comparing with other models.

#include <cstdio>
#include <exception>
#include <iostream>
#include <stdexcept>
#include <string>

#include "tests/cycles/machine.hpp"

namespace fxdyn::cycles {
namespace {

void print_cycles(const Elf& elf, const std::string& function) {
  Machine machine;
  for (const Elf::Section& section : elf.sections) machine.write(section.address, section.bytes);
  const auto symbol = elf.symbols.find(function);
  if (symbol == elf.symbols.end()) throw std::runtime_error("no function " + function);
  for (int i = 0; i < 4; ++i) machine.set_register(i, ram_begin + 0x1000U * static_cast<unsigned>(i + 1));
  constexpr std::uint32_t caller = flash_begin + flash_bytes - 4;
  machine.set_register(13, ram_begin + ram_bytes);
  machine.set_register(14, caller | 1);
  machine.set_pc(symbol->second & ~1U);
  machine.begin();
  if (machine.run(caller) != Machine::Stop::address) throw std::runtime_error(function + " does not return");
  const Trace trace = machine.end();
  std::printf("%s %zu", function.c_str(), trace.steps.size());
  for (const Ends ends : {Ends::fastest, Ends::likely, Ends::slowest})
    std::printf(" %llu",
                static_cast<unsigned long long>(Core({.ends = ends, .ideal_memory = true}, FlashSetup{}).run(trace)));
  std::printf("\n");
}

}  // namespace
}  // namespace fxdyn::cycles

int main(int count, char** arguments) {
  if (count < 3) {
    std::cerr << "usage: function_cycles IMAGE.elf FUNCTION...\n";
    return 2;
  }
  try {
    const auto elf = fxdyn::cycles::Elf::read(arguments[1]);
    for (int i = 2; i < count; ++i) fxdyn::cycles::print_cycles(elf, arguments[i]);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "function_cycles: " << error.what() << "\n";
    return 1;
  }
}
