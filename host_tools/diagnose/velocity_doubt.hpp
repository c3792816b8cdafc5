#pragma once

#include <Eigen/Dense>

#include "host_tools/effects/forward.hpp"
#include "host_tools/regression/dataset.hpp"

namespace fxdyn::diagnosis {

/// Variance of the friction torque that an uncertain velocity makes, in units of the noise's variance:
///   u = E[(tau(dq + sigma_dq n) - tau(dq))^2] / sigma^2, n of variance 1.
/// While sigma_dq is small beside the sign's width its slope counts; else the chance of the wrong sign,
///   4 F^2 Phi(-|dq| / sigma_dq), F the friction that turns with it.
/// A joint that stands still (|dq| < sigma_dq) bears any friction up to F, and for as long: its rows have one error
/// between them, so that of N rows each counts like one of N times the variance.
/// sigma_dq is what the position filter leaves of the encoder's noise, VelocityError, and the motion that it takes
/// away, lost_velocity().
/// @param joint its friction @param dq, load of the joint at full rate @param sigma RMS of the residual's noise
/// @returns filtered and decimated; zeros where the velocity is measured or the joint has no friction
Eigen::VectorXd velocity_doubt(const ProcessedLog& log, std::size_t joint, const JointFit& friction,
                               const Eigen::Ref<const Eigen::VectorXd>& dq,
                               const Eigen::Ref<const Eigen::VectorXd>& load, double sigma);

/// What friction may change by within an uncertain velocity, at full rate [N*m | N]:
///   F (tanh((|dq| + d sigma_dq) / width) - tanh((|dq| - d sigma_dq) / width)), F and sigma_dq as above.
/// @param load of which load friction is a part @param deviations d
/// @returns one a sample; zeros where the velocity is measured or the joint has no friction
Eigen::VectorXd friction_swing(const ProcessedLog& log, std::size_t joint, const JointFit& friction,
                               const Eigen::Ref<const Eigen::VectorXd>& dq,
                               const Eigen::Ref<const Eigen::VectorXd>& load, double deviations);

}  // namespace fxdyn::diagnosis
