#pragma once

#include "model/effects/asymmetric_friction.hpp"
#include "model/effects/backlash.hpp"
#include "model/effects/coulomb.hpp"
#include "model/effects/cross_position.hpp"
#include "model/effects/delay.hpp"
#include "model/effects/eccentricity.hpp"
#include "model/effects/elasticity.hpp"
#include "model/effects/friction_drift.hpp"
#include "model/effects/friction_over_position.hpp"
#include "model/effects/gravity_compensator.hpp"
#include "model/effects/gravity_tilt.hpp"
#include "model/effects/joint_coupling.hpp"
#include "model/effects/load_curve.hpp"
#include "model/effects/load_friction.hpp"
#include "model/effects/lugre.hpp"
#include "model/effects/maxwell_slip.hpp"
#include "model/effects/motor_coupling.hpp"
#include "model/effects/offset.hpp"
#include "model/effects/payload.hpp"
#include "model/effects/position_curve.hpp"
#include "model/effects/presliding.hpp"
#include "model/effects/ripple.hpp"
#include "model/effects/rotor_inertia.hpp"
#include "model/effects/saturation.hpp"
#include "model/effects/soft_knee.hpp"
#include "model/effects/spring.hpp"
#include "model/effects/stribeck.hpp"
#include "model/effects/torque_gain.hpp"
#include "model/effects/velocity_curve.hpp"
#include "model/effects/viscous.hpp"
#include "model/effects/viscous_cubic.hpp"
#include "model/effects/viscous_quadratic.hpp"

// More effects without a change of this file: a header with `using UserEffects = EffectList<..>;` in namespace fxdyn.
// It is named by the macro FXDYN_EFFECTS, or by -DFXDYN_EFFECTS=.. to CMake, which writes configured_effects.hpp: no
// command line of the compiler changes, so only what includes this file is compiled again.
#if defined(FXDYN_EFFECTS)
#include FXDYN_EFFECTS
#elif __has_include("configured_effects.hpp")
#include "configured_effects.hpp"
#else
namespace fxdyn {
using UserEffects = EffectList<>;
}
#endif

namespace fxdyn {

/// The one list of joint effects: simulator, identifier, exporter and diagnoser walk it.
using Catalogue = Joined<
    EffectList<Viscous, Coulomb, Offset, RotorInertia, Stribeck, Presliding, AsymmetricFriction, ViscousQuadratic,
               ViscousCubic, LoadFriction, TorqueGain, Ripple, Spring, GravityCompensator, FrictionDrift, Saturation,
               JointCoupling, Delay, Elasticity, Backlash, Eccentricity, MotorCoupling, Lugre, MaxwellSlip,
               PositionCurve, VelocityCurve, LoadCurve, FrictionOverPosition, CrossPosition, SoftKnee>,
    UserEffects>;

/// Effects on the rigid body itself: they change its parameters and have no basis.
using BodyEffects = EffectList<Payload, GravityTilt>;

namespace detail {
template <class... Effects>
constexpr bool all_are_effects(EffectList<Effects...>) {
  return (Effect<Effects, Real> && ...);
}
template <class... Effects>
constexpr bool all_are_declared(EffectList<Effects...>) {
  return (Declared<Effects>::value && ...);
}
template <class... First, class... Second>
constexpr bool names_differ(EffectList<First...>, EffectList<Second...>) {
  const std::array names{First::name..., Second::name...};
  for (std::size_t i = 0; i < names.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      if (names[i] == names[k]) return false;
    }
  }
  return true;
}
static_assert(all_are_effects(Catalogue{}));
static_assert(names_differ(Catalogue{}, BodyEffects{}), "files name effects: no two may have the same name");
static_assert(all_are_declared(Catalogue{}) && all_are_declared(BodyEffects{}));
}  // namespace detail

}  // namespace fxdyn
