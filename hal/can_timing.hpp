#pragma once

#include <algorithm>
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
/// the one with most quanta, then the one that samples earlier, since its clock may be further off. Where the
/// controller has none, it does not compile.
consteval BitTiming bit_timing(BitTimingLimits limits, std::uint32_t clock_hz, BitRate wanted) {
  BitTiming best;
  std::uint64_t best_distance = 0;  // of the sample point, in quanta / 1000
  for (std::uint32_t prescaler = 1; prescaler <= limits.largest_prescaler; ++prescaler) {
    const std::uint64_t per_quantum = std::uint64_t{prescaler} * wanted.bits_per_second;
    if (per_quantum == 0 || clock_hz % per_quantum != 0) continue;
    const std::uint64_t quanta = clock_hz / per_quantum;
    if (quanta < wanted.fewest_quanta) continue;
    for (std::uint32_t segment2 = limits.largest_segment2; segment2 >= limits.smallest_segment2; --segment2) {
      if (quanta < std::uint64_t{1} + limits.smallest_segment1 + segment2) continue;
      const auto segment1 = static_cast<std::uint32_t>(quanta) - 1 - segment2;
      if (segment1 > limits.largest_segment1) break;
      const std::uint64_t sample = std::uint64_t{1000} * (1 + segment1), target = quanta * wanted.sample_permille;
      const std::uint64_t distance = sample > target ? sample - target : target - sample;
      if (distance > quanta * wanted.tolerance_permille) continue;
      if (best.prescaler != 0 && distance * best.quanta() >= best_distance * quanta) continue;
      best_distance = distance;
      best = {prescaler, segment1, segment2, std::min(segment2, limits.largest_jump_width)};
    }
  }
  if (best.prescaler == 0) no_bit_timing_gives_this_bit_rate_from_this_clock();
  return best;
}

/// What part of a bit the bus takes: there and back, transceivers included. Quanta, rounded up.
consteval std::uint32_t propagation_quanta(BitTiming timing, std::uint32_t clock_hz, std::uint32_t there_and_back_ns) {
  const std::uint64_t per_second = std::uint64_t{timing.prescaler} * 1'000'000'000;
  return static_cast<std::uint32_t>((std::uint64_t{there_and_back_ns} * clock_hz + per_second - 1) / per_second);
}

/// How far every clock of a bus may be off, in millionths, rounded down; two nodes are then twice as far apart. F.
/// Hartwich, A. Bassemir, "The Configuration of the CAN Bit Timing" (6th iCC, 1999), is in ISO 11898-1:
///   1. the jump width corrects what ten bits without an edge add up to;
///   2. the bit after an error flag, up to 13 bits after the last edge, is sampled within the phase segments.
/// `propagation`: quanta of `segment1` that are the propagation segment; the rest is phase segment 1. 0: not possible.
consteval std::uint32_t clock_tolerance_ppm(BitTiming nominal, std::uint32_t propagation) {
  if (propagation >= nominal.segment1) return 0;
  const std::uint64_t bit = nominal.quanta(), phase = std::min(nominal.segment1 - propagation, nominal.segment2);
  const std::uint64_t jump = std::min<std::uint64_t>(nominal.jump_width, phase);
  return static_cast<std::uint32_t>(
      std::min(1'000'000 * jump / (20 * bit), 1'000'000 * phase / (2 * (13 * bit - nominal.segment2))));
}

/// The same with the bit rate switched. A. Mutter, "Robustness of a CAN FD Bus System" (14th iCC, 2013), adds:
///   3. as 1, in the data phase;
///   4. as 2, where the error flag begins in the data phase: 6 fast bits, then 7 slow ones;
///   5. the switch, as late as two slow bits after the last edge: the jump width of the data phase corrects that, less
///      what a slower quantum before the switch leaves.
/// What transceivers make longer or shorter of a fast bit is not in it.
consteval std::uint32_t clock_tolerance_ppm(BitTiming nominal, BitTiming data, std::uint32_t propagation) {
  const std::uint32_t classic = clock_tolerance_ppm(nominal, propagation);
  if (classic == 0) return 0;
  const std::uint64_t bit = nominal.quanta(), fast = data.quanta(), slow_clock = nominal.prescaler,
                      fast_clock = data.prescaler;
  const std::uint64_t phase = std::min(nominal.segment1 - propagation, nominal.segment2);
  const std::uint64_t third = 1'000'000 * std::uint64_t{data.jump_width} / (20 * fast);
  const std::uint64_t fourth =
      1'000'000 * phase * slow_clock / (2 * ((6 * fast - data.segment2) * fast_clock + 7 * bit * slow_clock));
  // in periods of the clock, so that the prescalers' ratio needs no fraction
  const std::uint64_t jump = data.jump_width * fast_clock, lost = slow_clock > fast_clock ? slow_clock - fast_clock : 0;
  const std::uint64_t fifth =
      jump <= lost ? 0
                   : 1'000'000 * (jump - lost) /
                         (2 * ((2 * bit - nominal.segment2) * slow_clock + (data.segment2 + 4 * fast) * fast_clock));
  return static_cast<std::uint32_t>(std::min({std::uint64_t{classic}, third, fourth, fifth}));
}

}  // namespace fxdyn::hal
