// Every compiler makes the same tables of the functions in model/math.hpp and model/dense.hpp, those of today.

#include <cstddef>
#include <cstdint>

#include "model/dense.hpp"
#include "model/math.hpp"
#include "model/table_page.hpp"

namespace {

template <std::size_t size>
constexpr std::uint32_t checksum(const std::array<std::int32_t, size>& table) {
  fxdyn::Crc32 crc;
  for (const std::int32_t word : table) crc.add(static_cast<std::uint32_t>(word));
  return crc.value();
}

constexpr std::uint32_t checksum_of_asinh() {
  fxdyn::Crc32 crc;
  for (const fxdyn::raw::Parabola& piece : fxdyn::raw::asinh_table) {
    for (const std::int32_t word : {piece.c0, piece.c1, piece.c2}) crc.add(static_cast<std::uint32_t>(word));
  }
  return crc.value();
}

static_assert(checksum(fxdyn::raw::sine_table) == 0x551d7402);
static_assert(checksum(fxdyn::raw::tanh_table) == 0x655e0bc0);
static_assert(checksum(fxdyn::raw::power_table) == 0x097456fa);
static_assert(checksum_of_asinh() == 0x81d1aee1);
static_assert(checksum(fxdyn::raw::tanh_lines) == 0x2efb0815);

}  // namespace
