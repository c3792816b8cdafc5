#pragma once

#include "model/effects/coulomb.hpp"
#include "model/effects/offset.hpp"
#include "model/effects/presliding.hpp"
#include "model/effects/rotor_inertia.hpp"
#include "model/effects/stribeck.hpp"
#include "model/effects/viscous.hpp"

namespace fxdyn {

template <class... Effects>
struct EffectList {
  static constexpr std::size_t size = sizeof...(Effects);
  /// Calls visit.operator()<E>() for each effect, in order.
  template <class Visit>
  static constexpr void for_each(Visit&& visit) {
    (visit.template operator()<Effects>(), ...);
  }
  template <template <class...> class To>
  using apply = To<Effects...>;
};

/// The one list of effects: simulator, identifier, exporter and diagnoser walk it.
using Catalogue = EffectList<Viscous, Coulomb, Offset, RotorInertia, Stribeck, Presliding>;

namespace detail {
template <class... Effects>
constexpr bool all_are_effects(EffectList<Effects...>) {
  return (Effect<Effects, Real> && ...);
}
static_assert(all_are_effects(Catalogue{}));
}  // namespace detail

}  // namespace fxdyn
