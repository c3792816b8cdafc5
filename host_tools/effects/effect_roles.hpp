#pragma once

#include <string_view>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/joint_fit.hpp"

// Effects that some part of the host needs, found by what they declare rather than by their names.

namespace fxdyn {

/// A mass [kg] at a centre [m], fixed to the last link.
const EffectInfo& load_effect();
bool is_load(std::string_view effect);
/// Whether it turns gravity against the base.
bool turns_gravity(std::string_view effect);
/// Rotor and gears in front of the load: base parameters may hold it.
const EffectInfo& rotor_effect();
/// The nominal friction that turns with the sign of the velocity: amplitude s.
const EffectInfo& dry_friction_effect();
/// The nominal friction in proportion to the velocity.
const EffectInfo& viscous_friction_effect();
/// The friction in proportion to the load on the gear.
const EffectInfo& friction_of_load_effect();
/// The nominal torque that never changes.
const EffectInfo& constant_effect();
/// The friction that builds up over a path after a reversal, in place of dry friction.
const EffectInfo& presliding_effect();
/// The gear that bends in proportion to the load.
const EffectInfo& compliance_effect();
/// The gear that bends by a gap, whichever the load.
const EffectInfo& play_effect();
/// An error of position that repeats once a turn, whatever the load.
const EffectInfo& once_a_turn_effect();
/// Whether it bends the gear in proportion to the load.
bool is_compliance(const EffectInfo& info);

/// The joint's own; null: it has none.
const EffectFit* dry_friction_of(const JointFit& joint);
const EffectFit* compliance_of(const JointFit& joint);

}  // namespace fxdyn
