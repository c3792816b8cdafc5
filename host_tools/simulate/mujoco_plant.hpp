#pragma once

#include <optional>
#include <string>

#include "host_tools/simulate/closed_loop.hpp"
#include "host_tools/simulate/sensors.hpp"

// A second plant, with which the identified model can't share a mistake: rigid bodies, rotors, viscous and dry
// friction, springs and elastic gears are MuJoCo's, all other effects are written down here once more. The sign of a
// velocity is v / sqrt(v^2 + width^2) where an effect needs it, and MuJoCo's own soft constraint where Coulomb friction
// does: neither is the model's tanh.

namespace fxdyn {

/// Torques of a motion, by MuJoCo's inverse dynamics. The reference is the motion of the links; the run's q is what the
/// motors' encoders show, so it differs from the reference where gears bend, have play or run out of true.
/// @param age_s how long the robot has run before [s]
PlantRun prescribed_on_mujoco(const IdentifiedModel& plant, const Reference& links, double age_s);

/// The same controller as run_closed_loop() on MuJoCo's forward dynamics; it sees the motors' encoders. tau is what the
/// drives measure: the mean of both sides where the controller's torque jumps.
/// @throws DataError where the loop runs away.
PlantRun closed_loop_on_mujoco(const IdentifiedModel& plant, const Reference& reference,
                               const ClosedLoopSettings& settings);

/// Why this plant can't show an effect of a joint in a motion of that kind; none if it can.
std::optional<std::string> mujoco_refuses(const JointFit& joint, const EffectFit& effect, bool closed_loop);

}  // namespace fxdyn
