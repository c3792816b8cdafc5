#pragma once

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

}  // namespace fxdyn
