#pragma once

#include <mujoco/mujoco.h>

#include <memory>
#include <vector>

#include "host_tools/effects/forward.hpp"

namespace fxdyn {

/// A scenario's robot as MuJoCo has it: bodies, joints, and what of the joints' physics is MuJoCo's own. A joint with
/// a gear that bends or has play is two joints in a row along the same axis: the motor's, which the drive turns, and
/// the gear's, at minus the deflection.
struct MujocoModel {
  struct Options {
    bool bare = false;  ///< rigid bodies only, one joint each
    bool gears = true;  ///< the gears' stiffness and damping; else their joints are free
    double step_s = 0.000125;
  };
  MujocoModel(const IdentifiedModel& plant, const Options& options);

  std::size_t joints() const { return motor.size(); }

  std::unique_ptr<mjModel, void (*)(mjModel*)> model{nullptr, mj_deleteModel};
  std::unique_ptr<mjData, void (*)(mjData*)> data{nullptr, mj_deleteData};
  std::vector<int> motor;  ///< MuJoCo's index (qpos, qvel and dof alike) of each joint's motor
  std::vector<int> gear;   ///< of each joint's gear, -1: stiff
};

/// Amplitude of the Coulomb friction that is MuJoCo's `frictionloss`; what is left of it (negative) is applied.
struct CoulombShare {
  double own = 0, applied = 0;
};
CoulombShare coulomb_share(const JointFit& joint);

}  // namespace fxdyn
