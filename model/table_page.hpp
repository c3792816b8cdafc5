#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace fxdyn {

/// CRC-32 (ISO 3309, reflected polynomial 0xEDB88320, as in zlib) of words taken as little-endian bytes.
class Crc32 {
 public:
  constexpr void add(std::uint32_t word) {
    crc_ ^= word;
    for (int bit = 0; bit < 32; ++bit) crc_ = (crc_ >> 1) ^ (0xEDB88320U & (0U - (crc_ & 1U)));
  }
  constexpr std::uint32_t value() const { return ~crc_; }

 private:
  std::uint32_t crc_ = 0xFFFFFFFFU;
};

/// What a page of tables must agree on with the code that reads it: formats, joints, effects. FNV-1a, 32 bits.
class LayoutHash {
 public:
  constexpr void add(std::int32_t value) {
    for (int byte = 0; byte < 4; ++byte) mix(static_cast<std::uint32_t>(value >> (8 * byte)) & 0xFFU);
  }
  constexpr void add(std::string_view text) {
    for (const char c : text) mix(static_cast<unsigned char>(c));
    mix(0xFFU);
  }
  constexpr std::uint32_t value() const { return hash_; }

 private:
  constexpr void mix(std::uint32_t byte) { hash_ = (hash_ ^ byte) * 16777619U; }
  std::uint32_t hash_ = 2166136261U;
};

inline constexpr std::uint32_t table_magic = 0x31445846U;  ///< "FXD1"

struct PageHeader {
  std::uint32_t magic = table_magic;
  std::uint32_t layout_hash = 0;
  std::uint32_t words = 0;  ///< of the parameters that follow
  std::uint32_t crc32 = 0;  ///< of those words
};

/// A page of flash: header and parameters. Only 32-bit words, so that host and target agree on every byte.
template <class Model>
struct TablePage {
  PageHeader header;
  typename Model::Parameters parameters;
  static constexpr std::size_t parameter_words = sizeof(typename Model::Parameters) / 4;
  static_assert(sizeof(typename Model::Parameters) % 4 == 0 && alignof(typename Model::Parameters) == 4);
};

/// Magic, layout, size and CRC agree with this firmware's model. Reads the page word by word, as the flash holds it.
template <class Model>
bool page_is_valid(const TablePage<Model>& page) {
  using PageT = TablePage<Model>;
  if (page.header.magic != table_magic || page.header.layout_hash != Model::layout_hash() ||
      page.header.words != PageT::parameter_words) {
    return false;
  }
  Crc32 crc;
  // volatile: the page may have been reflashed apart from this image, so the compiler must not use the values it knows
  const auto* words = reinterpret_cast<const volatile std::uint32_t*>(&page.parameters);
  for (std::size_t i = 0; i < PageT::parameter_words; ++i) crc.add(words[i]);
  return crc.value() == page.header.crc32;
}

/// The page to compute with: the one in the flash's slot for updates where it is valid, else the one that the image was
/// built with. The slot may hold anything: an erased flash, half a page, one for another model.
template <class Model>
const TablePage<Model>& newest_valid_page(const TablePage<Model>& update, const TablePage<Model>& built_in) {
  return page_is_valid(update) ? update : built_in;
}

}  // namespace fxdyn
