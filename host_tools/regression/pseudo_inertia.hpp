#pragma once

#include <Eigen/Dense>

#include "host_tools/regression/regressor.hpp"

namespace fxdyn {

/// P = integral of [r; 1] [r; 1]^T dm = [[J, h], [h^T, m]] of a link (Wensing, Kim, Slotine 2018). A body of matter has
/// P > 0, and every P > 0 belongs to one: mass positive, inertia tensor positive with the triangle inequality.
Eigen::Matrix4d pseudo_inertia(const LinkInertia<Real>& link);
LinkInertia<Real> from_pseudo_inertia(const Eigen::Matrix4d& p);

/// The body with second moments about its centre that are safely positive: URDFs have points, rods and rounded tensors.
Inertial possible_body(const Inertial& body);

/// The same of a link's ten standard parameters, in the order of to_array().
Eigen::Matrix4d pseudo_inertia(const Eigen::Ref<const Eigen::VectorXd>& parameters);
Eigen::VectorXd pseudo_inertia_parameters(const Eigen::Matrix4d& p);

/// <M, dP/dpi_k> for the ten parameters pi_k: the gradient of <M, P>.
Eigen::VectorXd inner_products(const Eigen::Matrix4d& m);
/// tr(M dP_k M dP_l), 10 x 10: the Hessian of -log det P for M = P^-1.
Eigen::MatrixXd barrier_hessian(const Eigen::Matrix4d& m);

}  // namespace fxdyn
