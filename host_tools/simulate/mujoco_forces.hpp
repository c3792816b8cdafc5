#pragma once

#include <Eigen/Dense>
#include <optional>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/simulate/lugre_plant.hpp"

namespace fxdyn {

/// What the joints' effects ask of the drives, written from the physics and without model/effects: torques that MuJoCo
/// does not make itself, what the drives' sensors make of a torque, and what the gears do to the position.

/// State of all joints' motors at an instant.
struct DriveState {
  Eigen::VectorXd q, dq, ddq;
  Eigen::VectorXd load;  ///< rigid-body torque [N*m | N]
  double time_s = 0;     ///< since the robot was switched on
};

/// Contacts in parallel, each a spring that slips at half the way of the one before (effect `maxwell_slip`), by the
/// joint's way.
class SlippingContacts {
 public:
  /// @param way of the joint since the last call [rad | m]
  /// @return their force [N*m | N]
  double advance(const EffectFit& fit, double way);

 private:
  std::vector<double> bent_;  ///< [rad | m]
};

/// Steps with the motion: friction that builds up over a distance remembers it.
class DriveForces {
 public:
  explicit DriveForces(const IdentifiedModel& plant);
  /// Torque that every drive has to give for them [N*m | N].
  /// @throws InputError: an effect that this plant has no formula for
  Eigen::VectorXd operator()(const DriveState& state);

 private:
  const IdentifiedModel& plant_;
  std::vector<double> bristle_, bristle_q_;  ///< deflected share of the presliding friction, and where
  std::vector<SlippingContacts> slips_;
  std::vector<std::optional<LuGreBristles>> lugre_;
  Eigen::VectorXd last_dq_;
  double last_s_ = 0;
  bool started_ = false;
};

/// What the drives measure of a torque over a run, samples x joints: current limit, gain error and delay in the
/// scenario's order.
void measure_torque(const IdentifiedModel& plant, double step_s, Eigen::MatrixXd& tau);

/// Motor minus link of gears under the rigid-body torque, samples x joints [rad | m]: elasticity and play.
Eigen::MatrixXd gear_deflections(const IdentifiedModel& plant, double step_s, const Eigen::MatrixXd& load);

/// What the eccentricity of gear or disc adds to the encoder of a joint where it shows q, and its two derivatives by q.
struct Eccentric {
  double delta = 0, slope = 0, curvature = 0;
};
Eccentric eccentric(const JointFit& joint, double q);

}  // namespace fxdyn
