#include "host_tools/excite/series_coordinates.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace fxdyn {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int samples_per_harmonic = 16;  ///< while optimising

/// The peaks between the samples are higher than those at the samples by at most this share (highest harmonic).
double between_samples_share() { return 0.5 * std::pow(std::numbers::pi / samples_per_harmonic, 2); }

}  // namespace

SeriesCoordinates::SeriesCoordinates(const LimitCheck& check, const SeriesKind& kind, const ExciteSettings& settings)
    : check_(check),
      kind_(kind),
      period_s_(settings.period_s / kind.periods),
      null_(boundary_null_space(settings.order)),
      step_s_(period_s_ / (samples_per_harmonic * settings.order)) {
  const Index samples = samples_per_harmonic * settings.order;
  q_.resize(samples, null_.size());
  dq_.resize(samples, null_.size());
  ddq_.resize(samples, null_.size());
  for (Index i = 0; i < null_.size(); ++i) {
    const FourierJoint direction = series_of(VectorXd::Unit(null_.size(), i), 0);
    for (Index k = 0; k < samples; ++k) {
      const FourierState state = evaluate(direction, period_s_, step_s_ * static_cast<double>(k));
      q_(k, i) = state.q;
      dq_(k, i) = state.dq;
      ddq_(k, i) = state.ddq;
    }
  }
  Random random(settings.seed);
  unit_ = VectorXd::Zero(joints());
  constexpr int draws = 20;
  for (Index j = 0; j < joints(); ++j) {
    for (int i = 0; i < draws; ++i) unit_[j] += largest_scale(j, normal(random).normalized()) / draws;
  }
}

SeriesCoordinates::Decoded SeriesCoordinates::decode(const VectorXd& x) const {
  const Index samples = q_.rows();
  Decoded out{{}, {"", step_s_, VectorXd(samples), MatrixXd(samples, joints()), {}, {}}, 0};
  out.motion.dq = out.motion.ddq = out.motion.q;
  for (Index k = 0; k < samples; ++k) out.motion.t[k] = step_s_ * static_cast<double>(k);
  for (Index j = 0; j < joints(); ++j) {
    VectorXd z = unit_[j] * x.segment(j * per_joint(), null_.size());
    const double scale = largest_scale(j, z);
    if (scale < 1) {
      z *= scale;
      out.overflow += std::log(scale) * std::log(scale);
    }
    const double middle = 0.5 * (check_.lower()[j] + check_.upper()[j]);
    const double half = 0.5 * (check_.upper()[j] - check_.lower()[j]);
    const VectorXd moved = q_ * z;
    const double peak = between_samples_share() * half;
    const double first = check_.lower()[j] + peak - std::min(0.0, moved.minCoeff());
    const double last = check_.upper()[j] - peak - std::max(0.0, moved.maxCoeff());
    const double centre = std::max(first, std::min(last, middle + half * x[j * per_joint() + null_.size()]));
    out.series.push_back(series_of(z, centre));
    out.motion.q.col(j) = moved.array() + centre;
    out.motion.dq.col(j) = dq_ * z;
    out.motion.ddq.col(j) = ddq_ * z;
  }
  return out;
}

VectorXd SeriesCoordinates::random(std::uint64_t seed, const VectorXd& centre) const {
  Random random(seed);
  VectorXd x(size());
  for (Index j = 0; j < joints(); ++j) {
    const VectorXd z = normal(random);
    x.segment(j * per_joint(), null_.size()) = z * (largest_scale(j, z) / unit_[j]);
    x[j * per_joint() + null_.size()] =
        (2 * centre[j] - check_.lower()[j] - check_.upper()[j]) / (check_.upper()[j] - check_.lower()[j]);
  }
  return x;
}

void SeriesCoordinates::shrink(VectorXd& x, double factor) const {
  for (Index j = 0; j < joints(); ++j) x.segment(j * per_joint(), null_.size()) *= factor;
}

VectorXd SeriesCoordinates::normal(Random& random) const {
  VectorXd z(null_.size());
  for (double& value : z) value = random.normal();
  return z;
}

FourierJoint SeriesCoordinates::series_of(const VectorXd& z, double centre) const {
  return {centre, null_.a * z.head(null_.a.cols()), null_.b * z.tail(null_.b.cols())};
}

double SeriesCoordinates::largest_scale(Index j, const VectorXd& z) const {
  const VectorXd moved = q_ * z;
  const double range = std::max(0.0, moved.maxCoeff()) - std::min(0.0, moved.minCoeff());
  const double sampled = 1 - between_samples_share(), kept = sampled * (1 - check_.margin());
  const MotionLimits& limits = check_.limits();
  return std::min({sampled * (check_.upper()[j] - check_.lower()[j]) / range,
                   kept * kind_.velocity * limits.velocity[j] / (dq_ * z).cwiseAbs().maxCoeff(),
                   kept * kind_.acceleration * limits.acceleration[j] / (ddq_ * z).cwiseAbs().maxCoeff()});
}

}  // namespace fxdyn
