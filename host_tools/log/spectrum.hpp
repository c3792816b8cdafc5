#pragma once

#include <Eigen/Dense>

namespace fxdyn {

/// One-sided power spectral density of a signal.
struct Spectrum {
  double resolution_hz = 0;
  Eigen::VectorXd density;  ///< at 0, 1, 2, .. times the resolution [unit^2 / Hz]
  double frequency(Eigen::Index bin) const { return static_cast<double>(bin) * resolution_hz; }
  /// Below which `share` of the power between 0 (excluded) and `ceiling_hz` lies.
  double frequency_of_share(double share, double ceiling_hz) const;
  /// RMS of white noise of the level that the highest octave has.
  double noise_rms() const;
};

/// Welch's method: segments of at most 4096 samples that overlap by half, each without its trend, Hann window. A signal
/// of more than 2^18 samples is looked at in 128 segments spread over it.
Spectrum welch(const Eigen::VectorXd& signal, double step_s);

}  // namespace fxdyn
