#pragma once

#include <Eigen/Dense>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "model/rigid_body.hpp"

namespace fxdyn {

/// The rigid body of a model: its links, with what is fixed to the last one and as its base stands.
struct RigidBody {
  std::vector<LinkGeometry<Real>> geometry;
  std::vector<LinkInertia<Real>> inertia;
  Vector3<double> up;
};
RigidBody rigid_body_of(const IdentifiedModel& model);

/// tau = M(q) ddq + C(q, dq) dq + g(q) [N*m | N] of each sample, samples x joints: rnea<Real>() of as many samples at
/// once as the processor takes, with the same bits.
void rigid_torques(const RigidBody& body, const Eigen::Ref<const Eigen::MatrixXd>& q,
                   const Eigen::Ref<const Eigen::MatrixXd>& dq, const Eigen::Ref<const Eigen::MatrixXd>& ddq,
                   Eigen::Ref<Eigen::MatrixXd> tau);

}  // namespace fxdyn
