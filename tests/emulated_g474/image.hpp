#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace fxdyn::emulated {

/// An ELF file for a 32-bit Arm as `flash` programs it: what lies at which physical address, and its symbols.
struct Image {
  struct Segment {
    std::uint32_t address = 0;
    std::vector<std::uint8_t> bytes;
  };
  std::vector<Segment> segments;
  std::map<std::string, std::uint32_t> symbols;

  /// Throws std::runtime_error that says what is wrong with the file.
  static Image load(const std::string& path);
  std::uint32_t symbol(const std::string& name) const;
};

}  // namespace fxdyn::emulated
