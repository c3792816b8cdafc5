#pragma once

#include <Eigen/Dense>

#include "host_tools/diagnose/deflection_fit.hpp"

namespace fxdyn::diagnosis {

/// d deflection / d z by central differences, rows x directions.
Eigen::MatrixXd load_slopes(const DeflectionRows& rows, const DeflectionSet& set);

/// Gauss-Newton over coefficients, shapes and load together, until it brings nothing more: a search over steps ends
/// beside the optimum, by more than the noise.
void polish(DeflectionRows& rows, const Eigen::VectorXd& colour, DeflectionSet& set);

/// Standard deviations of coefficients and shapes with all that is fitted beside them: offsets, shapes, and the load in
/// every direction in which the base parameters are uncertain. A compliance is deflection over load, and link encoders
/// know the deflection far better than torque knows the load.
///   Cov = s^2 (X^T X + s^2 diag(0, 1))^-1, X = [columns, d deflection / d ln shape, d deflection / d z],
/// s^2 the variance of the whitened rows, a priori z is 0 with variance 1
/// @param covariance of the base parameters; empty: the load is taken as it is
void add_deviations(DeflectionRows rows, const Eigen::VectorXd& colour, const IdentifiedModel& model,
                    const Eigen::MatrixXd& covariance, bool with_rotor, DeflectionSet& set);

}  // namespace fxdyn::diagnosis
