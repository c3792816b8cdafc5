#pragma once

#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/identify/options.hpp"
#include "host_tools/regression/dataset.hpp"

// Flexible joints from a second encoder on the link, paper Eqs. 12 and 42 (whose sum misses J ddq):
//   motor  J_eff ddq + friction(dq) + K delta + B d(delta)/dt = tau,  delta = q - qlink
//   link   K delta + B d(delta)/dt = load, the rigid body's torque on the link's motion
// q is the motor's encoder over the gear ratio; all on the joint side of the gearbox. The second line is what is
// fitted, turned round: delta = (load behind a low-pass of relaxation B / K) / K + constant. The deflection, 0.1 to 2
// mrad and measured by two quantised encoders, is the noisy side and has to stand on the left: least squares of the
// torque on it gives a K that is too small. The load follows from motion whose noise is small against it.

namespace fxdyn {

struct FlexibleInput {
  const IdentifiedModel& model;           ///< as identified: rigid body on the link's motion, effects on the motor's
  const std::vector<ProcessedLog>& logs;  ///< those that fit
};

/// K, B and J_eff of every joint that has a link encoder, in chain order. J_eff is the model's `rotor_inertia` where it
/// has one. On the first joints, where rotor inertia cannot be distinguished from link inertia by torque (it is in the
/// base parameters), the deflection separates them: the rotor's share bends no gear. Standard deviations are those of
/// a residual that is correlated over up to half a second, and of the load by those of the base parameters (taken as
/// independent, which is mostly too much). Play and a once-a-turn error of the gear or the encoder are taken out where
/// the data shows them, and noted. A joint that does not bend measurably, or whose load is not known well enough, comes
/// back with found = false.
std::vector<FlexibleJoint> identify_flexible(const FlexibleInput& input, const FlexibleOptions& options = {});

/// The same gear as an effect of the model: compliance 1 / K, relaxation B / K (0 where B is not significant).
EffectFit elasticity_effect(const FlexibleJoint& joint, const FlexibleOptions& options = {});

}  // namespace fxdyn
