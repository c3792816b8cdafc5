#include "host_tools/signals/spectrum.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <unsupported/Eigen/FFT>
#include <vector>

namespace fxdyn {

using Eigen::Index;
using Eigen::VectorXd;

void EnergyByFrequency::add(const Spectrum& spectrum, double ceiling_hz, double duration_s) {
  const Index bins =
      std::min<Index>(spectrum.density.size(), static_cast<Index>(ceiling_hz / spectrum.resolution_hz) + 1);
  for (Index k = 1; k < bins; ++k)
    energy_[spectrum.frequency(k)] += spectrum.density[k] * spectrum.resolution_hz * duration_s;
}

void EnergyByFrequency::add_shares(const EnergyByFrequency& other) {
  const double all = other.whole();
  if (!(all > 0)) return;
  for (const auto& [frequency, energy] : other.energy_) energy_[frequency] += energy / all;
}

double EnergyByFrequency::frequency_of_share(double share) const {
  const double all = whole();
  double sum = 0, last = 0;
  for (const auto& [frequency, energy] : energy_) {
    sum += energy;
    last = frequency;
    if (sum >= share * all) break;
  }
  return last;
}

double EnergyByFrequency::whole() const {
  double sum = 0;
  for (const auto& [frequency, energy] : energy_) sum += energy;
  return sum;
}

double Spectrum::noise_rms() const {
  const Index n = density.size();
  VectorXd high = density.tail(n / 2);
  std::nth_element(high.begin(), high.begin() + high.size() / 2, high.end());
  // the median of an averaged periodogram is its mean, nearly
  return std::sqrt(high[high.size() / 2] * frequency(n - 1));
}

Spectrum welch(const VectorXd& signal, double step_s) {
  const Index n = signal.size();
  Index length = 1;
  while (2 * length <= std::min<Index>(n, 4096)) length *= 2;
  const Index available = std::max<Index>(1, 2 * (n / length) - 1);
  const Index segments = std::min<Index>(available, 128);
  VectorXd window(length);
  for (Index k = 0; k < length; ++k)
    window[k] =
        0.5 - 0.5 * std::cos(2 * std::numbers::pi * (static_cast<double>(k) + 0.5) / static_cast<double>(length));
  const Index bins = length / 2 + 1;
  Spectrum out{1 / (static_cast<double>(length) * step_s), VectorXd::Zero(bins)};
  Eigen::FFT<double> fft;
  std::vector<double> in(static_cast<std::size_t>(length));
  std::vector<std::complex<double>> lines;
  for (Index s = 0; s < segments; ++s) {
    const Index from = segments == 1 ? 0 : (n - length) * s / (segments - 1);
    const double first = signal.segment(from, std::max<Index>(1, length / 16)).mean();
    const double last =
        signal.segment(from + length - std::max<Index>(1, length / 16), std::max<Index>(1, length / 16)).mean();
    for (Index k = 0; k < length; ++k) {
      const double trend = first + (last - first) * static_cast<double>(k) / static_cast<double>(length);
      in[static_cast<std::size_t>(k)] = (signal[from + k] - trend) * window[k];
    }
    fft.fwd(lines, in);
    for (Index k = 0; k < bins; ++k) out.density[k] += std::norm(lines[static_cast<std::size_t>(k)]);
  }
  out.density *= 2 * step_s / (window.squaredNorm() * static_cast<double>(segments));
  return out;
}

}  // namespace fxdyn
