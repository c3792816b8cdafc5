#pragma once

#include <Eigen/Dense>
#include <cstddef>

#include "host_tools/effects/filter_fit.hpp"

namespace fxdyn {

/// RMS of an encoder's white noise [rad | m]: as its spectrum shows it, at least that of its step, step / sqrt(12).
double position_noise(const FilterFit& filter, std::size_t joint);
/// What the position filter passes [Hz]; at most half of the sampling rate.
double position_band(const FilterFit& filter, double step_s);
/// RMS of that noise in the velocity [rad/s | m/s]: differentiated and filtered, with density 2 h sigma^2 up to f_c,
///   sigma_dq^2 = int_0^f_c (2 pi f)^2 2 h sigma^2 df = (2 pi sigma)^2 2 h f_c^3 / 3,
/// as a wall at f_c would leave it; the filter's slope leaves 0.89 of that. h: step_s, of the recording.
double velocity_noise(const FilterFit& filter, std::size_t joint, double step_s);
/// RMS error of the velocity that an encoder makes, by how fast the joint moves [rad/s | m/s]. White noise makes
/// velocity_noise() of it, whatever the velocity is. Steps that come more slowly than the filter passes are a
/// staircase, no white noise: below cutoff step the velocity is wrong by sqrt(2) cutoff step.
class VelocityError {
 public:
  VelocityError(const FilterFit& filter, std::size_t joint, double step_s);
  /// .. as far as it may be: where no step comes, the joint may still move within one.
  double operator()(double dq) const;
  /// .. as far as the velocity shows it: the fewer steps come, the less of them there is in it.
  double shown(double dq) const;

 private:
  double with_stairs(double dq, double square) const;
  double white_, slow_;
};

/// RMS around each sample of the motion that the position filter takes away, up to the frequency at which the motion
/// sinks into the noise [rad/s | m/s]: a controlled joint that sticks and comes loose turns back faster than one filter
/// for all joints passes. What the encoder makes of its own in that band is taken off.
/// @param raw, filtered position @returns empty: there is nothing beyond that
Eigen::VectorXd lost_velocity(const Eigen::VectorXd& raw, const Eigen::Ref<const Eigen::VectorXd>& filtered,
                              const FilterFit& filter, std::size_t joint, double step_s);

}  // namespace fxdyn
