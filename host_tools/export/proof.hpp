#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/numbers/bounded.hpp"
#include "host_tools/support/progress.hpp"

namespace fxdyn {

/// What holds for every motion within the joint limits; the error only while no saturation is counted (setpoints that
/// jump let the differences of a deflection saturate).
struct Proof {
  Ranges ranges;                ///< of every kind of number: formats that hold them can't overflow
  Eigen::VectorXd torque;       ///< |tau| of each joint before its torque limit, at most [N*m | N]
  Eigen::VectorXd effects;      ///< |tau - structural torque| of each joint, at most
  Eigen::VectorXd error;        ///< |fixed - double| of each joint, at most; zero without formats
  std::vector<Kind> too_large;  ///< what could leave its format: empty, or it is no proof
};

/// Runs the model in BoundedNumbers over the joint limits. With formats, their roundings count; the error of effect
/// states holds as creeping_ticks says.
Proof prove(const IdentifiedModel& model, const Formats* formats);

/// The bounds of prove() on the rigid body's torque are for all positions at once. This one cuts positions and
/// velocities into boxes, the worst first, until no joint's bound is more than `goal` times what was attained or
/// `boxes` are used up: |structural torque| of each joint, at most.
Eigen::VectorXd prove_structural(const IdentifiedModel& model, const Eigen::VectorXd& attained, double goal, int boxes);

/// The largest |tau| of each joint before its torque limit that a search finds within the joint limits: random states,
/// then one coordinate after the other to where the torque is largest. A lower bound of what is possible.
struct Attained {
  Eigen::VectorXd structural, total;
};
Attained attain(const IdentifiedModel& model);

}  // namespace fxdyn
