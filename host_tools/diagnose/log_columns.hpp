#pragma once

#include <Eigen/Dense>
#include <map>
#include <memory>
#include <mutex>
#include <tuple>
#include <vector>

#include "host_tools/diagnose/options.hpp"
#include "host_tools/diagnose/session_log.hpp"
#include "host_tools/diagnose/unknowns.hpp"
#include "host_tools/effects/model_value.hpp"
#include "host_tools/effects/robot_columns.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/signals/motion.hpp"

namespace fxdyn::diagnosis {

/// Change of the torques with base parameters and effects along the motion of the logs, around the model of each log's
/// session. Through what follows in the torque's path (torque gain, saturation, load-dependent friction).
class LogColumns {
 public:
  LogColumns(const Models& models, const std::vector<SessionLog>& logs);

  const Models& models() const { return *models_; }
  const Options& options() const;
  const std::vector<SessionLog>& logs() const { return *logs_; }
  std::size_t joints() const;
  bool has_baseline() const;
  /// Joints whose healthy session has structure (Models::background).
  const std::vector<std::size_t>& background() const;
  /// The robot today, and one of its joints as URDF and fit know it.
  const IdentifiedModel& current() const;
  const Joint& joint_of_robot(std::size_t joint) const;
  const JointFit& joint(std::size_t joint) const;
  /// The model of a log's session.
  const IdentifiedModel& model(std::size_t log) const;
  const JointFit& joint(std::size_t log, std::size_t joint) const;
  const Motion& motion(std::size_t log) const { return *motions_[log]; }
  const RobotColumns& robot(std::size_t log) const { return *robot_[log]; }

  Eigen::Index base_parameters() const { return static_cast<Eigen::Index>(base_.columns.size()); }
  /// The first base parameter that a joint feels; it feels all behind it.
  Eigen::Index first_base(std::size_t joint) const;
  /// Columns of the base parameters that a joint feels, filtered and decimated: rows x parameters. What depends on the
  /// load (friction, a gear that bends) has columns of its own and is left out.
  Eigen::MatrixXd base_rows(std::size_t log, std::size_t joint) const;

  /// Columns of an effect at full rate. Safe from several threads.
  EffectColumns of(std::size_t log, const EffectCandidate& candidate) const { return of(log, candidate, *robot_[log]); }
  /// .. of a group, around the model with the rotor that comes with it.
  EffectColumns of(std::size_t log, const Group& group) const;
  /// What columns of a joint's effects share is kept for the next of them. Of many or long logs that is too much for
  /// all joints at once: call this after a joint's last one. Safe from several threads.
  void forget_shared(std::size_t joint) const;

  /// Columns as the torque shows them: through what follows them in the torque's path.
  Eigen::MatrixXd follow(std::size_t log, std::size_t joint, Eigen::MatrixXd columns) const;
  /// What a model says of a log's motion [N*m | N]; its gears bend by what is not noise.
  Eigen::MatrixXd torque_of(std::size_t log, ModelValue model) const;
  /// .. of another motion that is sampled like the log's, for the model of the log's session.
  Eigen::MatrixXd torque_along(std::size_t log, const MotionRows& motion) const;
  /// Whether torque_of() differs from RobotColumns::torque() for that.
  bool bends_slowly(std::size_t log) const;

 private:
  EffectColumns of(std::size_t log, const EffectCandidate& candidate, const RobotColumns& columns) const;
  Eigen::MatrixXd base_columns(std::size_t log, const std::vector<std::size_t>& joints, Eigen::Index begin,
                               Eigen::Index samples) const;
  std::shared_ptr<const RobotColumns> robot_with(std::size_t log, const Group& group) const;

  std::shared_ptr<const Models> models_;
  const std::vector<SessionLog>* logs_;
  DhChain chain_;
  BaseSet base_;
  std::vector<const Motion*> motions_;  ///< of the logs' caches
  std::vector<const Motion*> slow_;     ///< by log: its motion below bending_hz; null: the same
  std::vector<std::shared_ptr<const RobotColumns>> robot_;
  /// By log, joint, the rotor's inertia, and whether the effect bends.
  mutable std::map<std::tuple<std::size_t, std::size_t, double, bool>, std::shared_ptr<const RobotColumns>> for_group_;
  mutable std::mutex for_group_mutex_;
};

}  // namespace fxdyn::diagnosis
