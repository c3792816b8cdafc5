#include "tests/cycles/assembled.hpp"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <vector>

#include <unistd.h>

namespace fxdyn::cycles {
namespace {

std::vector<char> assemble(const std::string& lines) {
  std::string directory = (std::filesystem::temp_directory_path() / "fxdyn-cycles-XXXXXX").string();
  if (mkdtemp(directory.data()) == nullptr) throw std::runtime_error("no directory for temporary files");
  std::ofstream(directory + "/code.s") << ".syntax unified\n.thumb\n" << lines << "\nbkpt 0\n.align 2\n";
  const std::string command = "cd " + directory +
                              " && arm-none-eabi-as -mcpu=cortex-m4 -mthumb code.s -o code.o && "
                              "arm-none-eabi-objcopy -O binary --only-section=.text code.o code.bin";
  const bool done = std::system(command.c_str()) == 0;
  std::ifstream file(directory + "/code.bin", std::ios::binary);
  std::vector<char> code{std::istreambuf_iterator<char>(file), {}};
  file.close();
  std::filesystem::remove_all(directory);
  if (!done || code.empty()) throw std::runtime_error("does not assemble:\n" + lines);
  return code;
}

}  // namespace

Assembled::Assembled(const std::string& lines) {
  const std::vector<char> code = assemble(lines);
  machine_.write(flash_begin, std::as_bytes(std::span(code)));
  for (int i = 0; i < 7; ++i) machine_.set_register(i, ram_begin + 0x1000);
  machine_.set_register(7, 4);
  machine_.set_register(13, ram_begin + 0x8000);
  machine_.set_pc(flash_begin);
  machine_.begin();
  if (machine_.run() != Machine::Stop::breakpoint) throw std::runtime_error("does not end:\n" + lines);
  trace_ = machine_.end();
}

}  // namespace fxdyn::cycles
