#pragma once

#include <Eigen/Dense>
#include <functional>

#include "host_tools/effects/forward.hpp"
#include "host_tools/signals/motion.hpp"
#include "host_tools/support/error.hpp"

namespace fxdyn {

/// A loop that its controller can't hold.
struct RunsAway : DataError {
  RunsAway() : DataError("the closed loop runs away") {}
};

/// Where the robot is asked to go: samples `step_s` apart.
struct Reference : MotionRows {
  double step_s = 0;
  Eigen::MatrixXd feedforward;  ///< torque added to the controller's [N*m | N]; empty: none

  Reference() = default;
  Reference(double step, Eigen::MatrixXd position, Eigen::MatrixXd velocity, Eigen::MatrixXd acceleration,
            Eigen::MatrixXd torque)
      : MotionRows{std::move(position), std::move(velocity), std::move(acceleration)},
        step_s(step),
        feedforward(std::move(torque)) {}
};

/// Joint by joint tau = kp (q_r - q) + kd (dq_r - dq) + feedforward with kp = M w^2 and kd = 2 damping M w,
/// w = 2 pi bandwidth, M the joint's own inertia at the start pose [kg m^2 | kg].
struct ClosedLoopSettings {
  double bandwidth_hz = 6;
  double damping = 0.7;
  int substeps = 4;  ///< of the plant between two samples of the reference
  int hold = 1;      ///< the controller acts at every hold-th sample of the reference and keeps its torque till then
  double age_s = 0;  ///< how long the robot has run before (Evaluator::warm_up) [s]
  /// What the controller sees of q is rounded to this, and its dq is what that changed by since it acted last; 0: it
  /// sees both exactly [rad | m].
  double encoder_step = 0;
  /// Torque that a drive adds at this sample of the reference, asked for when its time has come [N*m | N]; empty: none.
  /// Of closed_loop_on_mujoco().
  std::function<Eigen::VectorXd(Eigen::Index)> drive{};
};

/// What a controller sees of the motors.
class SeenMotion {
 public:
  SeenMotion(const ClosedLoopSettings& settings, double step_s)
      : encoder_(settings.encoder_step), period_s_(settings.hold * step_s) {}
  void look(const Eigen::VectorXd& q, const Eigen::VectorXd& dq);
  const Eigen::VectorXd& q() const { return q_; }
  const Eigen::VectorXd& dq() const { return dq_; }

 private:
  double encoder_, period_s_;
  Eigen::VectorXd q_, dq_;
};

/// At the reference's samples. dq and ddq are derivatives of q; ddq jumps with the controller's torque, and shows the
/// mean of both sides there. tau: the torque that the controller applies from the sample on [N*m | N].
struct ClosedLoopRun : MotionRows {
  Eigen::MatrixXd tau;
};

/// The model as a plant, M(q) ddq + h(q, dq) + effects(q, dq) = tau: without the effects that need the running total
/// (delay, saturation, torque_gain) or act on the position (elasticity, backlash, eccentricity). Those change what is
/// measured rather than the motion.
IdentifiedModel forward_plant(IdentifiedModel model);

/// The plant in closed loop, from the reference's first state on.
/// @throws DataError where the model's mass matrix is not positive definite, RunsAway.
ClosedLoopRun run_closed_loop(const IdentifiedModel& plant, const Reference& reference,
                              const ClosedLoopSettings& settings);

/// Of every joint [rad | m, and per s, s^2].
struct OpenLoopStart {
  Eigen::VectorXd q, dq, ddq;
};

/// The plant moved by a torque alone, which is linear between its samples.
/// @param tau samples x joints, `step_s` apart; the first is that of `start` [N*m | N]
/// @return q at the samples of tau [rad | m]
/// @throws DataError where the model's mass matrix is not positive definite, RunsAway.
Eigen::MatrixXd run_open_loop(const IdentifiedModel& plant, const OpenLoopStart& start, double step_s,
                              const Eigen::MatrixXd& tau, int substeps, double age_s);

}  // namespace fxdyn
