#pragma once

#include "model/effect.hpp"
#include "model/shapes.hpp"

namespace fxdyn {

/// How far the bristles of a LuGre contact bend while it slides, in parts of the most (Han, Wu, Hui 2025, Eq. 21):
///   n(dq) = share + (1 - share) exp(-(dq / velocity)^2),   0.25 <= share <= 1.
template <class N>
struct SlidingLevel {
  Unit<N> bell;      ///< exp(-(dq / velocity)^2)
  Unit<N> n;         ///< n(dq)
  Ratio<N> inverse;  ///< 1 / n

  /// @param inverse_velocity 1 / velocity [s/rad | s/m]
  /// @param most_fall 1 - share
  static constexpr SlidingLevel at(Velocity<N> dq, InverseVelocity<N> inverse_velocity, Unit<N> most_fall) {
    const auto one = N::one();
    const auto bell = bell_of<N>(N::template clamp<Argument<N>>(dq * inverse_velocity));
    const auto fall = N::template proven_narrow<Unit<N>>(most_fall * N::template proven_narrow<Unit<N>>(one - bell));
    const auto n = N::template proven_narrow<Unit<N>>(one - fall);
    return {bell, n, reciprocal_of(n)};
  }
};

/// The deflection of LuGre's bristles in parts of the most, y = sigma0 z / Fs, |y| <= 1 (Canudas de Wit et al. 1995;
/// Han, Wu, Hui 2025, Eq. 20):
///   dy/dt = (dq - |dq| y / n(dq)) / distance.
///
/// Each tick is stepped exactly for a constant velocity, the mean of those at its ends, and n of its end:
///   y <- y e + n s (1 - e),   e = exp(-|mean| tick / (distance n)).
/// It is stable for every tick, since y stays between its last value and n s. The mean makes the path of a tick right
/// to second order; with the velocity at its end alone the error is 20 to 80 times as large.
template <class N>
struct Bristle {
  Unit<N> y{};

  /// @param way dq of this tick + dq of the one before
  /// @param inverse_path tick / distance [s/rad | s/m]
  template <class Way>
  constexpr void step(Way way, InversePath<N> inverse_path, const SlidingLevel<N>& level) {
    const auto mean = N::template proven_narrow<Velocity<N>>(half_of(way));
    const auto rate = N::template proven_narrow<InversePath<N>>(inverse_path * level.inverse);
    const auto decay = exp_negative(N::template clamp<Argument<N>>(magnitude(mean) * rate));
    y = relax<N>(y, signed_as(level.n, way), N::template proven_narrow<Unit<N>>(N::one() - decay));
  }

  /// distance dy/dt = dq - |dq| y / n [rad/s | m/s]
  constexpr Velocity<N> rate(Velocity<N> dq, const SlidingLevel<N>& level) const {
    const auto sliding = magnitude(dq) * N::template proven_narrow<Ratio<N>>(y * level.inverse);
    return N::template proven_narrow<Velocity<N>>(align(dq, sliding) - sliding);
  }
};

}  // namespace fxdyn
