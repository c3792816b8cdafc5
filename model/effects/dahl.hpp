#pragma once

#include "model/effect.hpp"

namespace fxdyn {

/// State of the Dahl model, dz/dt = (dq / distance) (1 - sign(dq) z), |z| <= 1: the normalised friction force of
/// contacts that bend before they slide. Stepped exactly for a velocity that is constant over the tick,
///   z <- z e + sign(dq) (1 - e),  e = exp(-|dq| tick / distance),
/// since the explicit Euler step is unstable once |dq| tick > 2 distance. Dahl 1968; paper Eq. 20 with constant g.
template <class N>
struct Dahl {
  Unit<N> z{};

  /// @param inverse_path tick / distance [s/rad | s/m]
  constexpr Unit<N> step(Velocity<N> dq, InversePath<N> inverse_path, Saturations&) {
    const auto decay = exp_negative(N::template clamp<Argument<N>>(magnitude(dq) * inverse_path));
    z = relax<N>(z, sign_of(dq), N::template proven_narrow<Unit<N>>(N::one() - decay));
    return z;
  }
};

}  // namespace fxdyn
