#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace fxdyn {

/// SHA-256 of bytes that come piece by piece (FIPS 180-4, sec. 6.2). For whoever decides by it that work of hours need
/// not be done again: FNV-1a of files.hpp has 64 bits only.
class Sha256 {
 public:
  void add(std::string_view bytes);
  /// 64 hex digits. Nothing may be added afterwards.
  std::string text();

 private:
  void block(const unsigned char* bytes);

  std::array<std::uint32_t, 8> state_{0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                      0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  std::array<unsigned char, 64> rest_{};
  std::uint64_t bytes_ = 0;
};

/// Of a file, read piece by piece.
/// @throws InputError: it can't be read
std::string sha256_of_file(const std::filesystem::path& file);

}  // namespace fxdyn
