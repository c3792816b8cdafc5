#pragma once

#include <vector>

#include "host_tools/exchange/simple_robot.hpp"
#include "host_tools/project/project.hpp"

namespace fxdyn {

/// What the train logs leave open of each joint's numbers. The coefficients are fitted once more to the logs that made
/// the model, in its own structure; their covariance is the fit's (a sandwich of the residual's autocorrelation, shapes
/// unknown too). The numbers of a simulator are linear in the coefficients theta of the joint's friction and rotor
/// (fit_friction() of the friction's torque alone):
///   (damping, friction, armature) = J theta,   covariance = J Cov(theta) J^T.
/// An offset or a spring is no friction: what the logs leave open between it and gravity is no matter of these numbers.
/// Effects that no column stands for (KeptEffects) are taken as they are, and so is a BLS. What bodies and other joints
/// leave open is in Cov(theta); the covariance between joints is not handed on.
/// @param train the logs that made the model
/// @throws DataError: fewer rows than parameters, or a joint that never moves
std::vector<JointRange> joint_ranges(const Project& project, const IdentifiedModel& model,
                                     std::vector<ProcessedLog> train);

/// Squared radius of the ellipsoid x^T Cov^-1 x <= radius^2 that holds a normal vector of 1, 2 or 3 numbers with a
/// probability of 90 %, where Cov is an estimate with so many degrees of freedom: k times the 90 % quantile of Fisher's
/// F with k and `freedom` (Hotelling 1931). The quantile of chi squared, its limit, belongs to a covariance that is
/// known.
double squared_radius_90(std::size_t numbers, double freedom);

}  // namespace fxdyn
