#include "host_tools/regression/encoder_noise.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_tools/signals/filter.hpp"

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

VelocityError::VelocityError(const FilterFit& filter, std::size_t joint, double step_s)
    : white_(velocity_noise(filter, joint, step_s)),
      slow_(position_band(filter, step_s) * filter.encoder_step[joint]) {}

double VelocityError::with_stairs(double dq, double square) const {
  const double stairs = slow_ > 0 ? 2 * square * std::exp(-0.25 * dq * dq / (slow_ * slow_)) : 0;
  return std::sqrt(white_ * white_ + stairs);
}

double VelocityError::operator()(double dq) const { return with_stairs(dq, slow_ * slow_); }

double VelocityError::shown(double dq) const { return with_stairs(dq, slow_ * std::min(std::fabs(dq), slow_)); }

Eigen::VectorXd lost_velocity(const Eigen::VectorXd& raw, const Eigen::Ref<const Eigen::VectorXd>& filtered,
                              const FilterFit& filter, std::size_t joint, double step_s) {
  FilterFit wide = filter;
  wide.position_cutoff_hz = filter.crossing_hz;
  const double ends = position_band(wide, step_s), cutoff = position_band(filter, step_s);
  if (!(ends > cutoff) || joint >= filter.position_noise.size()) return {};
  const VelocityError kept(filter, joint, step_s), all(wide, joint, step_s);
  const Eigen::VectorXd dq = differentiate(filtered, step_s);
  const ZeroPhaseFilter around(cutoff, step_s);
  Eigen::VectorXd square =
      around.apply(differentiate(ZeroPhaseFilter(ends, step_s).apply(raw) - filtered, step_s).cwiseAbs2());
  const Eigen::VectorXd of_encoder =
      around.apply(dq.unaryExpr([&](double v) { return std::pow(all.shown(v), 2) - std::pow(kept.shown(v), 2); }));
  // So short a mean of noise has two free numbers, and e^-9 = 1e-4 of it is beyond that.
  constexpr double noise_at_most = 9;
  square = (square.array() > noise_at_most * of_encoder.array().max(0)).select(square - of_encoder, 0.0);
  // Both filters swing in at the ends, which no fit uses.
  const auto edge = std::min(square.size() / 2, static_cast<Eigen::Index>(3 / (cutoff * step_s)));
  square.head(edge).setZero();
  square.tail(edge).setZero();
  if (!(square.maxCoeff() > 0)) return {};
  return square.cwiseSqrt();
}

}  // namespace fxdyn
