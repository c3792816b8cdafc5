#pragma once

#include <optional>
#include <string>

#include "host_tools/effects/joint_fit.hpp"

namespace fxdyn {

/// Why the joint's `lugre` is no friction; nothing where it is one, or where there is none.
///
/// Its step is stable at every tick (model/effects/lugre.hpp), so that no tick is too long. What a set of parameters
/// can be is active: bristles that are still bent as at rest, y = 1, pull with static + damping dq (1 - 1 / n(dq)),
/// which turns round where damping is large and n < 1. LuGre friction is passive at every speed only with viscous >=
/// damping (1 - share) / share (Barabanov and Ortega, IEEE Trans. Automatic Control 45, 2000, pp. 830-832). That is
/// more than published sets have, since bristles don't stay bent at speed. Asked for is what any friction has to have:
/// it still brakes at the Stribeck velocity, where bristles let go, or at the joint's limit where that is less.
/// @param dq_limit of the joint [rad/s | m/s]; 0: not known
std::optional<std::string> lugre_is_no_friction(const JointFit& joint, double dq_limit);

/// The largest damping with which the joint's `lugre` is friction, by the same rule [N*m*s/rad | N*s/m]; nothing where
/// there is none.
std::optional<double> most_lugre_damping(const JointFit& joint, double dq_limit);

/// Lowers the damping of the joint's `lugre` to just below that, at the joint's limit.
void limit_lugre_damping(JointFit& joint);

}  // namespace fxdyn
