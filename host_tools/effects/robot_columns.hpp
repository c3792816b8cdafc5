#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/effects/model_value.hpp"
#include "host_tools/signals/motion.hpp"
#include "model/rigid_body.hpp"

namespace fxdyn {

/// An effect of the catalogue with its shape, at a joint of the robot.
struct EffectCandidate {
  std::string effect;
  std::size_t joint = 0;  ///< index from 0; no meaning for effects on the body
  std::vector<double> shape;
};

/// What one column of an effect stands for.
struct ColumnName {
  std::string name, unit;
};
/// The columns of an effect: its linear parameters, for payload `mass`, `mass com_x`, `mass com_y`, `mass com_z` (the
/// torque is not linear in `com`, but in mass and first moment).
/// @throws InputError: no such effect.
std::vector<ColumnName> column_names(std::string_view effect, JointType type);

/// Change of the torques for a change of each column's parameter [N*m | N per unit], at full rate: for each joint
/// samples x columns, 0 x 0 for joints that the effect does not reach.
struct EffectColumns {
  std::vector<Eigen::MatrixXd> joints;
};

/// Columns of effects that are added to a model, over one motion: d tau / d theta where the added effect's theta is
/// zero. Torque effects give their phi (effect_columns()) with the model's structural and total torque; everything else
/// (deflections, the body, torque effects where the model has effects of the total after them) is the difference that a
/// small theta makes in predict(), so that there is no second formula; where only the rigid body feels a deflection,
/// all those of a joint share the differences that its position, velocity and acceleration make. An effect that the
/// model has already is linearised around what the model has. States start at rest with the motion.
class RobotColumns {
 public:
  /// @param motion has to outlive this
  RobotColumns(const IdentifiedModel& model, const Motion& motion);

  /// Safe from several threads.
  /// @throws InputError: no such effect or joint, wrong number of shape parameters, or what effect_columns() refuses.
  EffectColumns operator()(const EffectCandidate& candidate) const;

  /// phi of a torque effect with the model's structural and total torque, as the effect emits it: samples x linear
  /// parameters.
  Eigen::MatrixXd phi(const EffectCandidate& candidate) const;
  /// The model's torque, and that of its rigid body (after deflections), samples x joints [N*m | N].
  const Eigen::MatrixXd& torque() const { return torque_; }
  const Eigen::MatrixXd& structural() const { return structural_; }
  /// [torque of `changed` - torque of the model] / theta at one joint, where nothing else differs than that joint's
  /// torque effects.
  Eigen::VectorXd own_slope(const IdentifiedModel& changed, std::size_t joint, double theta) const;
  /// What a joint's deflections share is kept, and made again where it is asked for after this. For those who hold many
  /// motions. Safe from several threads.
  void forget_slopes(std::size_t joint) const;

 private:
  /// [torque of `changed` - torque of the model] / theta
  Eigen::MatrixXd slope(const IdentifiedModel& changed, double theta) const;

  /// Sign of a joint's velocity as friction knows it: tanh(dq / width), for all samples.
  const Eigen::VectorXd& sign(std::size_t joint) const;
  struct Sign {
    std::once_flag made;
    Eigen::VectorXd values;
  };
  /// Change of the rigid body's torques with one joint's state, samples x joints each.
  struct ByState {
    Eigen::MatrixXd q, dq, ddq;
  };
  struct KeptByState {
    std::mutex mutex;
    std::shared_ptr<const ByState> slopes;
  };
  std::shared_ptr<const ByState> by_state(std::size_t joint) const;
  /// Torques for a deflection [rad | m per unit] of a joint, by its state's slopes.
  Eigen::MatrixXd of_deflection(std::size_t joint, const Eigen::VectorXd& delta) const;

  ModelValue model_;
  const Motion* motion_;
  Eigen::MatrixXd torque_, structural_;
  mutable std::vector<std::unique_ptr<Sign>> sign_;  ///< by joint
  /// Empty where something else than the rigid body feels a deflection, or the motion is too long to keep them.
  mutable std::vector<std::unique_ptr<KeptByState>> by_state_;
};

}  // namespace fxdyn
