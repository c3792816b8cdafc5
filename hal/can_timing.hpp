#pragma once

#include <cstdint>

namespace fxdyn::hal {

/// A bit as a controller divides it (ISO 11898-1, "bit timing"): 1 quantum for synchronisation, `segment1` (propagation
/// and phase 1) up to the sample point, `segment2` after it. A quantum is `prescaler` periods of the controller's
/// clock.
struct BitTiming {
  std::uint32_t prescaler = 0, segment1 = 0, segment2 = 0;
  std::uint32_t jump_width = 0;  ///< quanta by which a resynchronisation may move the sample point

  constexpr std::uint32_t quanta() const { return 1 + segment1 + segment2; }
  constexpr std::uint32_t bit_rate(std::uint32_t clock_hz) const { return clock_hz / (prescaler * quanta()); }
  constexpr std::uint32_t sample_permille() const { return 1000 * (1 + segment1) / quanta(); }
};

/// What a controller's registers can hold; every lower bound but those of the segments is 1.
struct BitTimingLimits {
  std::uint32_t largest_prescaler, smallest_segment1, largest_segment1, smallest_segment2, largest_segment2,
      largest_jump_width;
};

struct BitRate {
  std::uint32_t bits_per_second = 0;
  std::uint32_t sample_permille = 875;    ///< CiA 301 recommends 87.5 %
  std::uint32_t tolerance_permille = 25;  ///< how far the sample point may lie from there
  std::uint32_t fewest_quanta = 8;        ///< a bit of fewer resynchronises too coarsely (CiA 601-3)
};

/// Not constant, so that a call to it in a constant expression is an error whose message names the reason.
inline void no_bit_timing_gives_this_bit_rate_from_this_clock() {}

/// Prescaler and segments that give exactly the bit rate, with the sample point nearest to what is wanted; of equals
/// the one with most quanta. Where the controller has none, it does not compile.
consteval BitTiming bit_timing(BitTimingLimits limits, std::uint32_t clock_hz, BitRate wanted) {
  BitTiming best;
  std::uint32_t best_distance = wanted.tolerance_permille + 1;
  for (std::uint32_t prescaler = 1; prescaler <= limits.largest_prescaler; ++prescaler) {
    const std::uint64_t per_quantum = std::uint64_t{prescaler} * wanted.bits_per_second;
    if (per_quantum == 0 || clock_hz % per_quantum != 0) continue;
    const std::uint64_t quanta = clock_hz / per_quantum;
    if (quanta < wanted.fewest_quanta || quanta > std::uint64_t{1} + limits.largest_segment1 + limits.largest_segment2)
      continue;
    for (std::uint32_t segment2 = limits.smallest_segment2; segment2 <= limits.largest_segment2; ++segment2) {
      if (quanta < std::uint64_t{1} + limits.smallest_segment1 + segment2) break;
      const auto segment1 = static_cast<std::uint32_t>(quanta) - 1 - segment2;
      if (segment1 > limits.largest_segment1) continue;
      const BitTiming timing{prescaler, segment1, segment2,
                             segment2 < limits.largest_jump_width ? segment2 : limits.largest_jump_width};
      const std::uint32_t sample = timing.sample_permille();
      const std::uint32_t distance =
          sample > wanted.sample_permille ? sample - wanted.sample_permille : wanted.sample_permille - sample;
      if (distance < best_distance) {
        best_distance = distance;
        best = timing;
      }
    }
  }
  if (best.prescaler == 0) no_bit_timing_gives_this_bit_rate_from_this_clock();
  return best;
}

}  // namespace fxdyn::hal
