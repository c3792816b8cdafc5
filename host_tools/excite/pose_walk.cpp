#include "host_tools/excite/pose_walk.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/excite/motions.hpp"

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double share_of_limits = 0.5;

}  // namespace

double move_duration(const VectorXd& from, const VectorXd& to, const LimitCheck& check) {
  const double share = share_of_limits * (1 - check.margin());
  double longest = 0;
  for (Index j = 0; j < from.size(); ++j) {
    const double distance = std::fabs(to[j] - from[j]);
    longest = std::max({longest, 1.875 * distance / (share * check.limits().velocity[j]),
                        std::sqrt(5.7735026919 * distance / (share * check.limits().acceleration[j]))});
  }
  return std::max(1.0, std::ceil(longest / coarse_step_s)) * coarse_step_s;
}

MatrixXd PoseWalk::matrix() const {
  MatrixXd out(static_cast<Index>(poses.size()), poses.empty() ? 0 : poses.front().size());
  for (Index i = 0; i < out.rows(); ++i) out.row(i) = poses[static_cast<std::size_t>(i)].transpose();
  return out;
}

Motion PoseWalk::motion(double step_s) const { return dwell_and_move(matrix(), moves_s, dwell_s, step_s); }

bool PoseWalk::extend(const VectorXd& pose, const LimitCheck& check, double extra) {
  if (!poses.empty()) {
    if (pose == poses.back()) return false;
    const PoseWalk move{{poses.back(), pose}, {move_duration(poses.back(), pose, check)}};
    const Motion way = dwell_and_move(move.matrix(), move.moves_s, 0, 0.5 * coarse_step_s);
    if (!(check.violation(way, extra) == 0)) return false;
    moves_s.push_back(move.moves_s.front());
  }
  poses.push_back(pose);
  return true;
}

}  // namespace fxdyn
