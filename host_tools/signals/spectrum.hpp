#pragma once

#include <Eigen/Dense>
#include <map>

namespace fxdyn {

/// One-sided power spectral density of a signal.
struct Spectrum {
  double resolution_hz = 0;
  Eigen::VectorXd density;  ///< at 0, 1, 2, .. times the resolution [unit^2 / Hz]
  double frequency(Eigen::Index bin) const { return static_cast<double>(bin) * resolution_hz; }
  /// RMS of white noise of the level that the highest octave has.
  double noise_rms() const;
};

/// Energy by frequency, of signals of several lengths and resolutions.
class EnergyByFrequency {
 public:
  /// What lies between 0 (excluded) and `ceiling_hz` [unit^2 s].
  void add(const Spectrum& spectrum, double ceiling_hz, double duration_s);
  /// Another's as a share of its whole; nothing where it has none.
  void add_shares(const EnergyByFrequency& other);
  /// Below which `share` of the energy lies [Hz]; 0 where there is none.
  double frequency_of_share(double share) const;

 private:
  double whole() const;
  std::map<double, double> energy_;  // at frequency
};

/// Welch's method: segments of at most 4096 samples that overlap by half, each without its trend, Hann window. A signal
/// of more than 2^18 samples is looked at in 128 segments spread over it.
Spectrum welch(const Eigen::VectorXd& signal, double step_s);

}  // namespace fxdyn
