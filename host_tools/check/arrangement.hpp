#pragma once

#include <Eigen/Dense>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/check/options.hpp"
#include "host_tools/identify/torque_samples.hpp"
#include "host_tools/robot/robot.hpp"

namespace fxdyn {

/// How the columns of a log belong to the joints of a URDF. What a project says is the identity.
struct Arrangement {
  std::vector<Eigen::Index> motion_from, torque_from;  ///< joint -> column of q (dq, ddq), of tau
  Eigen::VectorXd motion_gain, motion_offset;          ///< q = gain * column + offset [rad | m]
  Eigen::VectorXd torque_gain;                         ///< tau = gain * column
  std::vector<Eigen::Vector3d> axis;                   ///< of each joint, in its URDF frame
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();   ///< base frame [m/s^2]
  std::vector<bool> sprung;                            ///< joints with a spring or a gravity compensator
};
Arrangement as_given(const Robot& robot);
/// The samples as an arrangement has them: a column a joint.
TorqueSamples arranged(const TorqueSamples& samples, const Arrangement& arrangement);

/// How well an arrangement explains the torque.
struct ArrangementScore {
  double nats = 0;      ///< minus log of the evidence, up to a constant that all arrangements share
  Eigen::VectorXd rms;  ///< residual of each joint [N*m | N]
};

/// Friction that builds up over a path after each reversal: per column of the motion, samples x paths, what Dahl's
/// state adds to the sign of the velocity (effect `presliding`). Empty: none.
using FrictionMemory = std::vector<Eigen::MatrixXd>;

/// What logs have taught of a robot's bodies: normal, in the frames of the URDF's axes.
struct KnownBodies {
  Eigen::VectorXd mean;
  Eigen::MatrixXd information;
};

/// The evidence of arrangements of one robot's samples. Model: tau_j = Y_j(q, dq, ddq) pi + nominal friction, rotor and
/// offset of the joint, friction with a memory where it is given, and a torque over the joint's own position where the
/// arrangement has a spring there. pi is normal about the URDF's bodies (pseudo-inertia metric, see barrier_hessian()),
/// with that of options.mass_errors that has the most evidence; where a link has no body about a sphere, options.vague
/// times as wide. The residual's deviation is each joint's own, found by iteration. What it consists of is structure
/// more than noise, so only `options.independent` rows of a joint count. The way that a joint goes counts as well: one
/// that leaves twice the URDF's range needs limits that are wrong, r times too narrow in a share r^-options.beyond of
/// all URDFs.
class ArrangementEvidence {
 public:
  ArrangementEvidence(Robot robot, TorqueSamples samples, const ArrangementOptions& options,
                      FrictionMemory memory = {});
  /// Of a log of the robot whose bodies other logs have taught: they take the place of the URDF's. For arrangements
  /// with the axes as given.
  ArrangementEvidence(Robot robot, TorqueSamples samples, const ArrangementOptions& options, KnownBodies bodies);

  /// What these samples teach of the bodies if the arrangement is right.
  KnownBodies bodies(const Arrangement& arrangement) const;

  /// Safe from several threads.
  ArrangementScore operator()(const Arrangement& arrangement) const;

  /// The regressors of an arrangement's motion, axes and gravity: most of the work. Columns and gains of the torque
  /// do not change them.
  struct Design {
    std::vector<Eigen::MatrixXd> gram, projection;  ///< per joint: X^T X; X^T tau of all torque columns
    Eigen::MatrixXd information;                    ///< of the bodies before any log, for a mass error of 1
    Eigen::VectorXd mean;                           ///< likewise
    std::vector<Eigen::VectorXd> own_square;        ///< per joint: mean squares of its own columns
  };
  Design design(const Arrangement& arrangement) const;
  ArrangementScore score(const Design& design, const Arrangement& arrangement) const;

  const Robot& robot() const { return robot_; }
  /// A joint that never moves holds any torque, as does its brake. By its column of the motion, against what the URDF
  /// lets the joint go: another joint's speed may be in other units.
  bool moves(Eigen::Index column) const { return moves_[static_cast<std::size_t>(column)]; }
  /// Lowest and highest position in a column.
  std::array<double, 2> range(Eigen::Index column) const {
    if (samples_.size() == 0) return {0, 0};
    return {samples_.q.col(column).minCoeff(), samples_.q.col(column).maxCoeff()};
  }
  /// How far the joint would go beyond twice what the URDF lets it, logarithm of the ratio; 0: it does not.
  double excess(const Arrangement& arrangement, Eigen::Index joint) const;
  /// Twice as many samples as unknowns: fewer prove nothing.
  bool enough() const;

 private:
  struct Fit {
    ArrangementScore score;
    Eigen::VectorXd x;            ///< of the bodies, then of each joint's own columns
    Eigen::MatrixXd information;  ///< of x
  };
  Fit fit(const Design& design, const Arrangement& arrangement, double mass_error) const;
  Fit best_fit(const Design& design, const Arrangement& arrangement) const;
  Eigen::Index memory_columns() const { return memory_.empty() ? 0 : memory_.front().cols(); }
  Eigen::Index own_columns() const;
  double friction_power(const Eigen::MatrixXd& gram, const Eigen::VectorXd& x) const;
  bool take_out_impossible(Eigen::Index joint, const Eigen::MatrixXd& gram, const Eigen::VectorXd& x,
                           std::vector<bool>& taken, Eigen::MatrixXd& prior) const;

  Robot robot_;
  TorqueSamples samples_;
  ArrangementOptions options_;
  FrictionMemory memory_;
  std::optional<KnownBodies> known_;
  std::vector<bool> moves_;
  Eigen::VectorXd torque_square_;  ///< mean squares of the torque columns
};

}  // namespace fxdyn
