#pragma once

#include "host_tools/effects/forward.hpp"
#include "host_tools/simulate/closed_loop.hpp"

namespace fxdyn {

/// Where the motors have to be for the links to be where the reference has them:
///
///   q_m = q_r + delta(load of the links at q_r, dq_r, ddq_r; encoder at q_m),  dq_m, ddq_m its derivatives
///
/// delta by the model's own effects on the position. Those of the load (elasticity, backlash) know it from the planned
/// motion of the links: nothing to solve. What goes with the encoder's angle (eccentricity) is iterated; it contracts
/// by |d delta/dq| <= 0.15. A flexible joint's link position is a flat output (De Luca, Book, "Robots with flexible
/// elements", Springer Handbook of Robotics): delta follows ddq_r, so that ddq_m takes four derivatives of q_r. Where
/// it has fewer the motors would have to jump: the load's delta is smoothed (zero phase, a twentieth of the sampling
/// rate).
///
/// A drive takes q_m for its controller and for its feedforward. Both references are samples x joints at the tick, in
/// the links' angle, behind the gearbox [rad | m, and per s, s^2]; the result has no feedforward. Without effects on
/// the position it is the reference itself.
Reference motor_reference(const IdentifiedModel& model, const Reference& links);

/// Whether motors and links of the model are at different places.
bool bends(const IdentifiedModel& model);

}  // namespace fxdyn
