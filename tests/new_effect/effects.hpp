#pragma once

// What -DFXDYN_EFFECTS=tests/new_effect/effects.hpp adds to the catalogue.

#include "tanh_cubic_damping.hpp"

namespace fxdyn {

using UserEffects = EffectList<TanhCubicDamping>;

}  // namespace fxdyn
