#pragma once

#include <cstdint>

namespace fxdyn::emulated {

/// Emulated time in femtoseconds: a period of 170 MHz is rounded by 5e-8, and 64 bits hold five hours.
using Time = std::uint64_t;
inline constexpr Time second = 1'000'000'000'000'000, millisecond = second / 1000, microsecond = second / 1'000'000;
inline constexpr Time never = UINT64_MAX;

/// How long `count` periods of `hz` take.
constexpr Time periods(std::uint64_t count, std::uint64_t hz) {
  return static_cast<Time>(static_cast<unsigned __int128>(count) * second / hz);
}
/// How many whole periods of `hz` lie in `time`.
constexpr std::uint64_t whole_periods(Time time, std::uint64_t hz) {
  return static_cast<std::uint64_t>(static_cast<unsigned __int128>(time) * hz / second);
}

}  // namespace fxdyn::emulated
