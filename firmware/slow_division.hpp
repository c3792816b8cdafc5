#pragma once

#include <cstdint>

namespace fxdyn {

/// a / b rounded down, by 64 shifts and subtractions: for configuration, since firmware must not divide. b > 0
constexpr std::uint64_t slow_quotient(std::uint64_t a, std::uint32_t b) {
  std::uint64_t quotient = 0, rest = 0;
  for (int bit = 63; bit >= 0; --bit) {
    rest = rest << 1 | (a >> bit & 1U);
    const std::uint64_t fits = rest >= b ? 1U : 0U;
    rest -= fits * b;
    quotient = quotient << 1 | fits;
  }
  return quotient;
}

}  // namespace fxdyn
