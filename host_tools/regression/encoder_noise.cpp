#include "host_tools/regression/encoder_noise.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fxdyn {

double position_noise(const FilterFit& filter, std::size_t joint) {
  return std::max(filter.position_noise[joint], filter.encoder_step[joint] / std::sqrt(12.0));
}

double position_band(const FilterFit& filter, double step_s) {
  return std::min(filter.position_cutoff_hz, 0.5 / step_s);
}

double velocity_noise(const FilterFit& filter, std::size_t joint, double step_s) {
  const double noise = position_noise(filter, joint), cutoff = position_band(filter, step_s);
  return 2 * std::numbers::pi * noise * std::sqrt(2 * step_s * cutoff * cutoff * cutoff / 3);
}

}  // namespace fxdyn
