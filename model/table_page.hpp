#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "model/wrapping.hpp"

namespace fxdyn {

/// CRC-32 (ISO 3309, reflected polynomial 0xEDB88320, as in zlib) of words taken as little-endian bytes.
class Crc32 {
 public:
  constexpr void add(std::uint32_t word) {
    crc_ ^= word;
    for (int bit = 0; bit < 32; ++bit) crc_ = (crc_ >> 1) ^ (0xEDB88320U & wrapping_negate(crc_ & 1U));
  }
  constexpr std::uint32_t value() const { return ~crc_; }

 private:
  std::uint32_t crc_ = 0xFFFFFFFFU;
};

/// Of the page's own form: what stands in its header. Part of every layout hash, so that tables of another form neither
/// compile nor run.
inline constexpr std::int32_t page_version = 2;

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
  constexpr std::uint32_t value() const {
    LayoutHash whole = *this;
    whole.add(page_version);
    return whole.hash_;
  }

 private:
  constexpr void mix(std::uint32_t byte) { hash_ = wrapping_multiply(hash_ ^ byte, 16777619U); }
  std::uint32_t hash_ = 2166136261U;
};

inline constexpr std::uint32_t table_magic = 0x31445846U;  ///< "FXD1"

struct PageHeader {
  std::uint32_t magic = table_magic;
  std::uint32_t layout_hash = 0;
  std::uint32_t words = 0;  ///< of the parameters that follow
  std::uint32_t crc32 = 0;  ///< of those words
  /// Of the parameters of the whole robot that the first export of this model wrote: every update of it has the same.
  std::uint32_t origin = 0;
  std::uint32_t sequence = 0;  ///< 1 for that export, one more with every update
  std::uint32_t check = 0;     ///< CRC-32 of the words before: no flipped bit of the header is believed
};
inline constexpr std::size_t header_words = sizeof(PageHeader) / 4;

using HeaderWords = std::array<std::uint32_t, header_words>;
/// What `check` has to be.
constexpr std::uint32_t check_of(const HeaderWords& header) {
  Crc32 crc;
  for (std::size_t i = 0; i + 1 < header_words; ++i) crc.add(header[i]);
  return crc.value();
}
/// The header with its check.
constexpr PageHeader with_check(PageHeader header) {
  header.check = check_of(std::bit_cast<HeaderWords>(header));
  return header;
}

/// A page of flash: header and parameters. Only 32-bit words, so that host and target agree on every byte.
template <class Model>
struct TablePage {
  PageHeader header;
  typename Model::Parameters parameters;
  static constexpr std::size_t parameter_words = sizeof(typename Model::Parameters) / 4;
  static_assert(sizeof(typename Model::Parameters) % 4 == 0 && alignof(typename Model::Parameters) == 4);
};

/// What stands in flash now: tables may be flashed apart from the image, so the compiler must not compute with the
/// values that it was built with. Everything that reads tables goes through here; the compiler then knows the address
/// and nothing of what stands there.
template <class T>
const T& as_flashed(const T& tables) {
  const T* at = &tables;
  asm("" : "+r"(at));
  return *at;
}

/// Memory that gives every word that was written. A flash whose words can be unreadable (hal/stm32g4/flash.hpp) has the
/// same functions.
struct PlainMemory {
  static void begin() {}                             ///< a page is going to be read
  static constexpr bool all_read() { return true; }  ///< every word since begin() could be read
  static void trust() {}  ///< from here on what is read is computed with: what can't be read is a fault
};

enum class PageState : std::uint8_t {
  valid,
  empty,         ///< nothing was ever written there
  damaged,       ///< not a page, or not all of one
  unreadable,    ///< the memory says that it can't read it
  other_layout,  ///< whole, but for a firmware of another model
};

struct PageReading {
  PageHeader header;
  bool header_is_whole = false;
  PageState state = PageState::damaged;
};

/// Reads a page once, word by word, as the memory holds it. A function of its own: both pages are read by the same
/// code.
template <class Model, class Memory>
[[gnu::noinline]] PageReading read_page(const TablePage<Model>& page, Memory& memory) {
  constexpr std::size_t parameter_words = TablePage<Model>::parameter_words;
  memory.begin();
  // volatile: each word is read once
  const auto* words = reinterpret_cast<const volatile std::uint32_t*>(&as_flashed(page));
  HeaderWords header{};
  for (std::size_t i = 0; i < header_words; ++i) header[i] = words[i];
  const std::uint32_t first = header[0];
  bool uniform = first == 0 || first == UINT32_MAX;
  for (const std::uint32_t word : header) uniform = uniform && word == first;
  Crc32 crc;
  for (std::size_t i = 0; i < parameter_words; ++i) {
    const std::uint32_t word = words[header_words + i];
    uniform = uniform && word == first;
    crc.add(word);
  }
  PageReading out{std::bit_cast<PageHeader>(header)};
  out.header_is_whole = out.header.magic == table_magic && out.header.check == check_of(header);
  if (!memory.all_read())
    out.state = PageState::unreadable;
  else if (uniform)
    out.state = PageState::empty;
  else if (!out.header_is_whole)
    out.state = PageState::damaged;
  else if (out.header.layout_hash != Model::layout_hash() || out.header.words != parameter_words)
    out.state = PageState::other_layout;
  else if (out.header.crc32 == crc.value())
    out.state = PageState::valid;
  return out;
}

/// Magic, layout, size and both CRCs agree with this firmware's model.
template <class Model>
bool page_is_valid(const TablePage<Model>& page) {
  PlainMemory memory;
  return read_page(page, memory).state == PageState::valid;
}

/// What became of the page in the slot for updates. Object 0x2000:8 and the EMCY's detail have these numbers.
enum class UpdateSlot : std::uint8_t {
  empty = 0,
  used = 1,
  same = 2,          ///< the page that the image has itself
  older = 3,         ///< its sequence number is not higher than that of the image's own page
  other_origin = 4,  ///< no update of the model that the image was built with, as far as that can be read
  other_layout = 5,
  damaged = 6,
  unreadable = 7,
};
/// There is something that was meant to be used and can't be.
constexpr bool is_refused(UpdateSlot slot) { return slot >= UpdateSlot::older; }

constexpr std::string_view name_of(UpdateSlot slot) {
  constexpr std::array<std::string_view, 8> names{"empty",
                                                  "used",
                                                  "the same as the image's own",
                                                  "older than the image's own",
                                                  "of another model",
                                                  "for another layout",
                                                  "damaged",
                                                  "unreadable"};
  return names[static_cast<std::size_t>(slot)];
}

constexpr UpdateSlot judge_update(const PageReading& update, const PageReading& own) {
  switch (update.state) {
    case PageState::empty:
      return UpdateSlot::empty;
    case PageState::damaged:
      return UpdateSlot::damaged;
    case PageState::unreadable:
      return UpdateSlot::unreadable;
    case PageState::other_layout:
      return UpdateSlot::other_layout;
    case PageState::valid:
      break;
  }
  if (!own.header_is_whole || update.header.origin != own.header.origin) return UpdateSlot::other_origin;
  if (update.header.sequence > own.header.sequence) return UpdateSlot::used;
  const bool same = update.header.sequence == own.header.sequence && update.header.crc32 == own.header.crc32;
  return same ? UpdateSlot::same : UpdateSlot::older;
}

/// The tables that a firmware computes with.
template <class Model>
struct ChosenTables {
  const TablePage<Model>& page;
  PageHeader header;   ///< of that page
  bool valid = false;  ///< else nothing may be computed with them
  UpdateSlot update = UpdateSlot::empty;
};

/// The page in the slot for updates where it is whole, for this layout and newer than the page that the image was built
/// with, else that one. The slot may hold anything: an erased flash, half a page, one for another model.
template <class Model, class Memory>
ChosenTables<Model> choose_tables(const TablePage<Model>& built_in, const TablePage<Model>& slot, Memory& memory) {
  const PageReading own = read_page(built_in, memory), update = read_page(slot, memory);
  const UpdateSlot judged = judge_update(update, own);
  const bool is_update = judged == UpdateSlot::used;
  const bool valid = is_update || own.state == PageState::valid;
  if (valid) memory.trust();
  return {as_flashed(is_update ? slot : built_in), is_update ? update.header : own.header, valid, judged};
}
template <class Model>
ChosenTables<Model> choose_tables(const TablePage<Model>& built_in, const TablePage<Model>& slot) {
  PlainMemory memory;
  return choose_tables(built_in, slot, memory);
}

}  // namespace fxdyn
