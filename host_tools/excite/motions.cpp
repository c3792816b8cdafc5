#include "host_tools/excite/motions.hpp"

#include <cmath>
#include <numbers>
#include <numeric>

#include "host_tools/support/random.hpp"

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Motion play(const std::vector<FourierJoint>& series, double period_s, int periods, double step_s) {
  const auto samples = static_cast<Index>(std::llround(period_s * periods / step_s)) + 1;
  const auto n = static_cast<Index>(series.size());
  Motion motion{"", step_s, VectorXd(samples), MatrixXd(samples, n), MatrixXd(samples, n), MatrixXd(samples, n)};
  for (Index k = 0; k < samples; ++k) {
    motion.t[k] = step_s * static_cast<double>(k);
    for (Index j = 0; j < n; ++j) {
      const FourierState state = evaluate(series[static_cast<std::size_t>(j)], period_s, motion.t[k]);
      motion.q(k, j) = state.q;
      motion.dq(k, j) = state.dq;
      motion.ddq(k, j) = state.ddq;
    }
  }
  return motion;
}

Motion dwell_and_move(const MatrixXd& poses, const std::vector<double>& moves_s, double dwell_s, double step_s) {
  const Index n = poses.cols();
  const double duration =
      std::accumulate(moves_s.begin(), moves_s.end(), 0.0) + dwell_s * static_cast<double>(poses.rows());
  const auto samples = static_cast<Index>(std::llround(duration / step_s)) + 1;
  Motion motion{
      "", step_s, VectorXd(samples), MatrixXd(samples, n), MatrixXd::Zero(samples, n), MatrixXd::Zero(samples, n)};
  Index pose = 0;
  double from = 0;  // when the dwell at `pose` begins
  for (Index k = 0; k < samples; ++k) {
    const double t = motion.t[k] = step_s * static_cast<double>(k);
    while (pose + 1 < poses.rows() && t >= from + dwell_s + moves_s[static_cast<std::size_t>(pose)]) {
      from += dwell_s + moves_s[static_cast<std::size_t>(pose)];
      ++pose;
    }
    motion.q.row(k) = poses.row(pose);
    if (pose + 1 == poses.rows() || t <= from + dwell_s) continue;
    const double length = moves_s[static_cast<std::size_t>(pose)], u = (t - from - dwell_s) / length;
    const Eigen::RowVectorXd way = poses.row(pose + 1) - poses.row(pose);
    motion.q.row(k) += u * u * u * (10 + u * (6 * u - 15)) * way;
    motion.dq.row(k) = 30 * u * u * (1 - u) * (1 - u) / length * way;
    motion.ddq.row(k) = 60 * u * (1 - u) * (1 - 2 * u) / (length * length) * way;
  }
  return motion;
}

Motion one_pose(const VectorXd& q) {
  return {"", 1, VectorXd::Zero(1), q.transpose(), MatrixXd::Zero(1, q.size()), MatrixXd::Zero(1, q.size())};
}

Motion free_motion(const Robot& robot, const MotionLimits& limits) {
  constexpr Index states = 400;
  const auto joints = static_cast<Index>(robot.size());
  Random random(1);
  Motion motion{"", 1.0 / states, VectorXd::Zero(states), MatrixXd(states, joints), {}, {}};
  motion.dq = motion.ddq = motion.q;
  for (Index j = 0; j < joints; ++j) {
    const bool turns = robot.joints[static_cast<std::size_t>(j)].type == JointType::revolute;
    const double reach = turns ? std::numbers::pi : 0.5;
    for (Index k = 0; k < states; ++k) {
      motion.q(k, j) = random.uniform(-reach, reach);
      motion.dq(k, j) = random.uniform(-1, 1) * limits.velocity[j];
      motion.ddq(k, j) = random.uniform(-1, 1) * limits.acceleration[j];
    }
  }
  return motion;
}

}  // namespace fxdyn
