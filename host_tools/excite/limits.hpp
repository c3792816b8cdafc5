#pragma once

#include <Eigen/Dense>
#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/signals/motion.hpp"

namespace fxdyn {

/// What a motion may use, joint side, one a joint.
struct MotionLimits {
  Eigen::VectorXd lower, upper;                       ///< position [rad | m]
  Eigen::VectorXd velocity, acceleration;             ///< [rad/s | m/s], per s^2
  Eigen::VectorXd torque;                             ///< [N*m | N]; infinite: none given
  std::optional<std::array<Eigen::Vector3d, 2>> box;  ///< lowest and highest corner, base frame [m]
  std::vector<std::string> notes;                     ///< what was assumed
};

/// [limits] of the project, else the URDF's. Continuous joints without a range: -pi .. pi. No acceleration limit: twice
/// the velocity limit a second, noted.
/// @throws InputError naming limit and joint: no or an empty position range, no velocity limit.
MotionLimits motion_limits(const Project& project);

/// A limit and how much of it a motion uses.
struct Usage {
  std::string limit, unit;         ///< "position", "velocity", "acceleration", "torque", "box x"
  std::string where;               ///< joint, or link of the frame that comes nearest to the box
  double lowest = 0, highest = 0;  ///< attained
  double lower = 0, upper = 0;     ///< the limit
  /// Left unused, as a share: of the range to the nearer end (position, box), of the limit (the others).
  double margin = 0;
};

/// Checks motions against limits; torques by a model where there is one.
class LimitCheck {
 public:
  /// @throws InputError where a frame that never moves is outside the box.
  LimitCheck(const Robot& robot, MotionLimits limits, std::optional<IdentifiedModel> model, double margin);

  const MotionLimits& limits() const { return limits_; }
  bool knows_torque() const { return model_ != nullptr; }
  double margin() const { return margin_; }
  /// Position limits with the margin taken off at both ends, margin / 2 of the range each.
  const Eigen::VectorXd& lower() const { return lower_; }
  const Eigen::VectorXd& upper() const { return upper_; }

  /// How far a motion goes beyond torque limits and box, their margins taken off: sum over the limits of the excess as
  /// a share of the limit (torque) or of the box's extent. 0: within. `extra`: a further margin.
  double violation(const Motion& motion, double extra = 0) const;
  /// The limit that a motion violates most, for messages: "torque of joint 'j2' (300 N*m of 150)"; empty: none.
  std::string worst(const Motion& motion, double extra = 0) const;
  /// Every limit, over all the motions.
  std::vector<Usage> usage(const std::vector<Motion>& motions) const;

 private:
  template <class Visit>
  void each_excess(const Motion& motion, double extra, Visit&& visit) const;
  /// Lowest and highest coordinates of the frames that move, over the motion: 3 x 2, and the points that attain them.
  struct Extent {
    Eigen::Matrix<double, 3, 2> at;
    Eigen::Matrix<Eigen::Index, 3, 2> point;
  };
  Extent extent(const Motion& motion) const;

  Robot robot_;
  MotionLimits limits_;
  std::shared_ptr<const IdentifiedModel> model_;  ///< null: the torque is not known
  double margin_;
  Eigen::VectorXd lower_, upper_;
  std::vector<std::string> point_links_;  ///< of each point of link_origins()
  std::vector<Eigen::Index> moving_;      ///< points that move at all
};

/// The model that predicts the torque: directory/model.json, else the URDF's inertias, else none. Notes say which.
/// @throws InputError where model.json is of another robot.
std::optional<IdentifiedModel> torque_model(const Project& project, const std::filesystem::path& directory,
                                            std::vector<std::string>& notes);

/// The check of a project's motions, its margin and the model from torque_model(). @param notes gets what was assumed
LimitCheck limit_check(const Project& project, const std::filesystem::path& directory, std::vector<std::string>& notes);

/// Widths of the joints' sign of velocity: of directory/model.json, else the usual one [rad/s | m/s].
Eigen::VectorXd sign_widths(const Project& project, const std::filesystem::path& directory);

}  // namespace fxdyn
