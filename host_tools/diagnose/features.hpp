#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/diagnose/noise_model.hpp"

namespace fxdyn::diagnosis {

class Linearised;

/// Functions of the state that name no effect, for one joint: cosines over the ranges of all positions, velocities and
/// their products, friction over the own position and over each session's rows in their order, paths with memory,
/// random Fourier features of (q, dq, ddq, load). Filtered, decimated and whitened like everything else; rows x
/// features, those of time last. Zero on the healthy session's rows unless `healthy`.
Eigen::MatrixXd features(const LogColumns& columns, const NoiseModel& noise, const Blocks& blocks, std::size_t joint,
                         bool healthy);
Eigen::MatrixXd features(const Linearised& problem, std::size_t joint, bool healthy = false);

/// Cosines over the own position's range, as finely as is asked for, made like features(); zero on the healthy
/// session's rows.
Eigen::MatrixXd position_waves(const Linearised& problem, std::size_t joint, Eigen::Index count);

/// The own jerk, d(ddq)/dt, made likewise: no effect's, but noise has little of it. One column.
Eigen::MatrixXd jerk(const Linearised& problem, std::size_t joint);

/// Features of time alone: what changes with time does not come back.
constexpr Eigen::Index time_features = 15;

/// Columns of features() that belong together.
struct Family {
  Eigen::Index first, count;
};
/// In the order of the columns: each other joint's position, all their velocities, own position, own motion and load,
/// friction over the own position, random features (none of a family), friction over a session's rows in their order.
/// Those that know nothing but the motion come first.
std::vector<Family> families(std::size_t joints);
/// Places in families().
constexpr std::size_t place_of_own_position(std::size_t joints) { return joints > 1 ? joints : 0; }
constexpr std::size_t place_of_own_motion(std::size_t joints) { return place_of_own_position(joints) + 1; }

}  // namespace fxdyn::diagnosis
