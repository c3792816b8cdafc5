#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <vector>

#include "host_tools/excite/limits.hpp"
#include "host_tools/signals/fourier.hpp"
#include "host_tools/signals/motion.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn {

/// What a kind of trajectory does with the limits.
struct SeriesKind {
  const char* name;
  double velocity, acceleration;  ///< share of the limits that it may use
  int periods;                    ///< periods of the series within period_s
};

/// Series of one kind in coordinates of the null space: per joint z (null_a.cols() + null_b.cols()) and the centre as a
/// share of the half range. Whatever the coordinates, the series keeps the limits of position, velocity and
/// acceleration: it is scaled down where it would not, and its centre moved.
class SeriesCoordinates {
 public:
  SeriesCoordinates(const LimitCheck& check, const SeriesKind& kind, const ExciteSettings& settings);

  Eigen::Index joints() const { return check_.lower().size(); }
  Eigen::Index per_joint() const { return null_.size() + 1; }
  Eigen::Index size() const { return joints() * per_joint(); }
  double period_s() const { return period_s_; }
  const SeriesKind& kind() const { return kind_; }

  struct Decoded {
    std::vector<FourierJoint> series;
    Motion motion;        ///< one period, coarse
    double overflow = 0;  ///< sum of squared logarithms of how far the coordinates asked beyond the limits
  };
  Decoded decode(const Eigen::VectorXd& x) const;

  /// A random series that reaches the tightest limit of each joint, about the given centre where the limits let it.
  Eigen::VectorXd random(std::uint64_t seed, const Eigen::VectorXd& centre) const;
  void shrink(Eigen::VectorXd& x, double factor) const;

 private:
  Eigen::VectorXd normal(Random& random) const;
  FourierJoint series_of(const Eigen::VectorXd& z, double centre) const;
  /// The factor at which z meets the tightest of the joint's limits.
  double largest_scale(Eigen::Index j, const Eigen::VectorXd& z) const;

  const LimitCheck& check_;
  SeriesKind kind_;
  double period_s_;
  FourierNullSpace null_;
  double step_s_;
  Eigen::MatrixXd q_, dq_, ddq_;  ///< samples x directions
  Eigen::VectorXd unit_;          ///< largest_scale() of a usual direction of length 1
};

}  // namespace fxdyn
