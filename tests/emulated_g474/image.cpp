#include "tests/emulated_g474/image.hpp"

#include <elf.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <span>
#include <stdexcept>

namespace fxdyn::emulated {
namespace {

template <class T>
T at(std::span<const char> file, std::size_t offset) {
  T value;
  if (offset + sizeof value > file.size()) throw std::runtime_error("the ELF file is cut off");
  std::memcpy(&value, file.data() + offset, sizeof value);
  return value;
}

void read_symbols(std::span<const char> file, const Elf32_Ehdr& head, std::map<std::string, std::uint32_t>& symbols) {
  for (std::size_t s = 0; s < head.e_shnum; ++s) {
    const auto table = at<Elf32_Shdr>(file, head.e_shoff + s * head.e_shentsize);
    if (table.sh_type != SHT_SYMTAB) continue;
    const auto names = at<Elf32_Shdr>(file, head.e_shoff + table.sh_link * std::size_t{head.e_shentsize});
    for (std::size_t i = 0; i < table.sh_size / sizeof(Elf32_Sym); ++i) {
      const auto symbol = at<Elf32_Sym>(file, table.sh_offset + i * sizeof(Elf32_Sym));
      const std::size_t name = names.sh_offset + symbol.st_name;
      if (symbol.st_name != 0 && name < file.size()) symbols.emplace(file.data() + name, symbol.st_value);
    }
  }
}

}  // namespace

Image Image::load(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) throw std::runtime_error("no such file: " + path);
  std::string file{std::istreambuf_iterator<char>(stream), {}};
  const auto head = at<Elf32_Ehdr>(file, 0);
  if (std::memcmp(head.e_ident, ELFMAG, SELFMAG) != 0 || head.e_ident[EI_CLASS] != ELFCLASS32 ||
      head.e_machine != EM_ARM)
    throw std::runtime_error(path + " is no ELF file for a 32-bit Arm");
  Image image;
  for (std::size_t p = 0; p < head.e_phnum; ++p) {
    const auto part = at<Elf32_Phdr>(file, head.e_phoff + p * head.e_phentsize);
    if (part.p_type != PT_LOAD || part.p_filesz == 0) continue;
    if (part.p_offset + std::size_t{part.p_filesz} > file.size()) throw std::runtime_error("the ELF file is cut off");
    const auto* begin = reinterpret_cast<const std::uint8_t*>(file.data()) + part.p_offset;
    image.segments.push_back({part.p_paddr, {begin, begin + part.p_filesz}});
  }
  read_symbols(file, head, image.symbols);
  return image;
}

std::uint32_t Image::symbol(const std::string& name) const {
  const auto found = symbols.find(name);
  if (found == symbols.end()) throw std::runtime_error("the image has no symbol " + name);
  return found->second;
}

}  // namespace fxdyn::emulated
