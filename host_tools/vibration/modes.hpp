#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/effects/forward.hpp"

namespace fxdyn {

/// One joint's motor under its position controller: tau = stiffness (q_r - q) + damping (dq_r - dq), per joint
/// [N*m/rad, N*m*s/rad | N/m, N*s/m]. Empty: motors that don't move.
struct MotorLoop {
  Eigen::VectorXd stiffness, damping;
};

struct Mode {
  double frequency_hz = 0;  ///< undamped
  double damping = 0;       ///< of critical
};

/// The link side's mass matrix at q, rotors left out: Newton-Euler with unit accelerations [kg m^2 | kg].
Eigen::MatrixXd link_mass(const IdentifiedModel& model, const Eigen::VectorXd& q);

/// Of a PD controller of this bandwidth and damping, kp = M w^2 and kd = 2 damping M w, M by the model: each joint's
/// links and rotor at the pose q, as ClosedLoopSettings has it of the robot.
MotorLoop motor_loop(const IdentifiedModel& model, const Eigen::VectorXd& q, double bandwidth_hz, double damping);

/// How motors and links swing about the pose q, slowest first. By the model's link inertias, compliances, relaxations
/// and rotors:
///
///   J q_m'' + kd q_m' + kp q_m + K delta + B delta' = 0,  M(q) q_l'' = K delta + B delta',  q_l = q_m - delta
///
/// Friction is left out: on a motor that sticks it is a spring beside kp, mostly a few per cent of it; so is the
/// controller's delay. Modes that don't swing are left out, and so are those that an inertia which is not positive
/// makes grow: a model with parameters off may have one on a joint that carries next to nothing.
std::vector<Mode> vibration_modes(const IdentifiedModel& model, const Eigen::VectorXd& q, const MotorLoop& loop);

}  // namespace fxdyn
