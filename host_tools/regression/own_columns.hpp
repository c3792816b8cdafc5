#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/forward.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn {

/// Columns of a joint's own parameters: its effects' linear ones in their order, then the BLS's inputs and nodes.
Eigen::Index own_count(const JointFit& design);

/// Of a BLS at full rate, samples x (inputs, nodes).
/// @throws InputError: inputs that need the rigid body's torque where the series has none
Eigen::MatrixXd bls_columns(const BroadLearningFit& bls, double sign_width, const JointSeries& series);

/// Rows of an effect that needs other joints' motion and has no memory of its own, filtered and decimated. `designs`:
/// of all joints, for the widths of their signs.
Eigen::MatrixXd rows_with_peers(const ProcessedLog& log, std::size_t joint, const EffectFit& fit,
                                const std::vector<JointFit>& designs);

}  // namespace fxdyn
