#include "host_tools/hil/elf.hpp"

#include <algorithm>
#include <string>

#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

/// Numbers at byte offsets of a file; 0 beyond its end.
struct Bytes {
  std::string_view content;
  std::uint32_t at(std::size_t offset, int bytes) const {
    std::uint32_t value = 0;
    for (int i = bytes; i-- > 0;) {
      const std::size_t place = offset + static_cast<std::size_t>(i);
      value = value << 8 | (place < content.size() ? static_cast<unsigned char>(content[place]) : 0U);
    }
    return value;
  }
  std::uint32_t word(std::size_t offset) const { return at(offset, 4); }
};

}  // namespace

std::optional<std::uint32_t> symbol_of(const std::filesystem::path& elf, std::string_view name) {
  // Tool Interface Standard, "Executable and Linking Format" 1.2, figures 1-3 (header), 1-8 (sections), 1-15 (symbols)
  constexpr std::uint32_t symbol_table = 2;
  constexpr std::size_t symbol_bytes = 16;
  const std::string content = read_file(elf);
  const Bytes file{content};
  const std::size_t sections = file.word(32), section_bytes = file.at(46, 2), count = file.at(48, 2);
  for (std::size_t s = 0; s < count; ++s) {
    const std::size_t section = sections + s * section_bytes;
    if (file.word(section + 4) != symbol_table) continue;
    const std::size_t names = file.word(sections + file.word(section + 24) * section_bytes + 16);
    const std::size_t begin = file.word(section + 16), end = std::min(begin + file.word(section + 20), content.size());
    for (std::size_t symbol = begin; symbol + symbol_bytes <= end; symbol += symbol_bytes) {
      const std::size_t text = names + file.word(symbol);
      if (text + name.size() < content.size() && file.content.substr(text, name.size()) == name &&
          content[text + name.size()] == '\0')
        return file.word(symbol + 4);
    }
  }
  return {};
}

}  // namespace fxdyn
