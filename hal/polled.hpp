#pragma once

#include <cstdint>

#include "hal/clock.hpp"

namespace fxdyn::hal {

/// Microseconds out of a free-running counter of 16 to 32 bits that counts up at any rate: adds up what it went on
/// since it was last read, so it has to be read more often than it wraps.
template <int bits>
class Microseconds {
 public:
  /// `counter_hz` as a constant: the target does not divide. Rounded to 2^-32 us a count.
  struct Rate {
    std::uint64_t us_per_count;  ///< scaled by 2^32
    consteval explicit Rate(std::uint64_t counter_hz)
        : us_per_count(((std::uint64_t{1'000'000} << 32) + counter_hz / 2) / counter_hz) {}
  };

  explicit constexpr Microseconds(Rate rate) : us_per_count_(rate.us_per_count) {}

  constexpr std::uint32_t now(std::uint32_t count) {
    constexpr auto mask = static_cast<std::uint32_t>((std::uint64_t{1} << bits) - 1);
    now_ += ((count - last_) & mask) * us_per_count_;  // only the lower 64 bits count: the result wraps after 2^32 us
    last_ = count;
    return static_cast<std::uint32_t>(now_ >> 32);
  }

 private:
  std::uint64_t us_per_count_;
  std::uint64_t now_ = 0;
  std::uint32_t last_ = 0;
};

/// A tick timer for boards that have nothing better than to look at the clock.
template <Clock C>
class PolledTimer {
 public:
  explicit constexpr PolledTimer(C& clock) : clock_(clock) {}
  Status start(std::uint32_t period_us) {
    if (period_us == 0) return Status::failed;
    period_us_ = period_us;
    next_us_ = clock_.now_us() + period_us;
    return Status::ok;
  }
  std::uint32_t expired() {
    std::uint32_t count = 0;
    // At most as many as an unsigned difference can tell; a caller that stays away for so long misses some.
    if (period_us_ == 0) return 0;
    for (const std::uint32_t now = clock_.now_us(); now - next_us_ < 0x8000'0000U; next_us_ += period_us_) ++count;
    return count;
  }

 private:
  C& clock_;
  std::uint32_t period_us_ = 0, next_us_ = 0;
};

}  // namespace fxdyn::hal
