#include "host_tools/vibration/shaper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "host_tools/support/error.hpp"
#include "host_tools/vibration/nonnegative.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double dies_away = 0.2;  ///< damping of modes that need no shaper
constexpr double slowest_times = 4;
constexpr Index poses = 12;             ///< along a path
constexpr int samples_per_octave = 24;  ///< of a band
constexpr double longest = 4;           ///< of a shaper, periods of the slowest frequency
constexpr double finest = 100;  ///< impulses per period of the slowest frequency: no more where ticks are shorter
constexpr int sharpenings = 12;

/// Amplitude after the last of `delay` + 1 impulses, of an impulse of 1 at each: cosine and sine parts in two rows.
MatrixXd response(double frequency_hz, double damping, Index delay, double step_s) {
  const double w = 2 * std::numbers::pi * frequency_hz, swing = w * std::sqrt(1 - damping * damping);
  MatrixXd rows(2, delay + 1);
  for (Index k = 0; k <= delay; ++k) {
    const double t = step_s * static_cast<double>(k);
    const double left = std::exp(-damping * w * step_s * static_cast<double>(delay - k));
    rows(0, k) = left * std::cos(swing * t);
    rows(1, k) = left * std::sin(swing * t);
  }
  return rows;
}

struct Sample {
  double frequency_hz, damping;
};

std::vector<Sample> samples_of(const std::vector<Band>& bands) {
  std::vector<Sample> samples;
  for (const Band& band : bands) {
    const double octaves = std::log2(band.high_hz / band.low_hz);
    const int count = static_cast<int>(std::ceil(samples_per_octave * octaves));
    for (int i = 0; i <= count; ++i)
      samples.push_back(
          {band.low_hz * std::exp2(count == 0 ? 0.0 : octaves * static_cast<double>(i) / count), band.damping});
  }
  return samples;
}

/// The best that `delay` + 1 impulses can do, and the largest residual in the samples. Least squares with
/// weights that grow where most is left (Lawson), which goes towards the smallest maximum.
struct Attempt {
  VectorXd impulses;
  double worst = 0;
};
Attempt attempt(const std::vector<Sample>& samples, Index delay, double step_s, double tolerance) {
  const auto count = static_cast<Index>(samples.size());
  std::vector<MatrixXd> rows;
  for (const Sample& s : samples) rows.push_back(response(s.frequency_hz, s.damping, delay, step_s));
  VectorXd weights = VectorXd::Constant(count, 1.0 / static_cast<double>(count)), left(count);
  Attempt best;
  for (int round = 0; round < sharpenings; ++round) {
    MatrixXd gram = MatrixXd::Zero(delay + 1, delay + 1);
    for (Index i = 0; i < count; ++i) {
      const MatrixXd& r = rows[static_cast<std::size_t>(i)];
      gram += weights[i] * r.transpose() * r;
    }
    const VectorXd impulses = least_on_simplex(gram);
    for (Index i = 0; i < count; ++i) left[i] = (rows[static_cast<std::size_t>(i)] * impulses).norm();
    const double worst = left.maxCoeff();
    if (best.impulses.size() == 0 || worst < best.worst) best = {impulses, worst};
    if (worst <= tolerance) break;
    weights = weights.cwiseProduct(left);
    weights /= weights.sum();
  }
  return best;
}

}  // namespace

double residual_vibration(const Shaper& shaper, double frequency_hz, double damping) {
  return (response(frequency_hz, damping, shaper.delay(), shaper.step_s) * shaper.impulses).norm();
}

Shaper design_shaper(const std::vector<Band>& bands, double step_s, double tolerance) {
  const std::vector<Sample> samples = samples_of(bands);
  if (samples.empty()) return {step_s, VectorXd::Ones(1)};
  const double slowest = std::min_element(bands.begin(), bands.end(), [](const Band& a, const Band& b) {
                           return a.low_hz < b.low_hz;
                         })->low_hz;
  const auto ticks = std::max<Index>(1, static_cast<Index>(std::floor(1 / (slowest * finest * step_s))));
  const double grid_s = step_s * static_cast<double>(ticks);
  Index too_short = 0, enough = static_cast<Index>(std::ceil(longest / slowest / grid_s));
  std::optional<Attempt> found;
  while (!found || too_short + 1 < enough) {
    const Index delay = found ? (too_short + enough) / 2 : enough;
    Attempt now = attempt(samples, delay, grid_s, tolerance);
    if (now.worst <= tolerance) {
      found = std::move(now);
      enough = delay;
    } else if (!found) {
      throw DataError(fmt::format("no shaper of {:.3g} s leaves less than {:.2g} of what swings at {:.3g} Hz or faster",
                                  grid_s * static_cast<double>(delay), tolerance, slowest));
    } else {
      too_short = delay;
    }
  }
  Shaper shaper{step_s, VectorXd::Zero(enough * ticks + 1)};
  for (Index i = 0; i <= enough; ++i) shaper.impulses[i * ticks] = found->impulses[i];
  return shaper;
}

std::vector<Band> bands_along(const IdentifiedModel& model, const Reference& path, const MotorLoop& loop,
                              double margin) {
  std::vector<Band> bands;
  for (Index i = 0; i < poses && path.q.rows() > 0; ++i) {
    const Index k = i * (path.q.rows() - 1) / (poses - 1);
    std::size_t at = 0;
    for (const Mode& mode : vibration_modes(model, path.q.row(k), loop)) {
      if (mode.damping > dies_away) continue;
      if (at == bands.size()) bands.push_back({mode.frequency_hz, mode.frequency_hz, mode.damping});
      Band& band = bands[at++];
      band.low_hz = std::min(band.low_hz, mode.frequency_hz);
      band.high_hz = std::max(band.high_hz, mode.frequency_hz);
      band.damping = std::min(band.damping, mode.damping);
    }
  }
  if (bands.empty()) return bands;
  const double fastest = slowest_times * bands.front().low_hz;
  std::erase_if(bands, [&](const Band& band) { return band.low_hz > fastest; });
  for (Band& band : bands) {
    band.high_hz = (1 + margin) * std::min(band.high_hz, fastest);
    band.low_hz *= 1 - margin;
  }
  return bands;
}

Reference shaped(const Reference& path, const Shaper& shaper) {
  const Index samples = path.q.rows(), delay = shaper.delay();
  Reference out{path.step_s, {}, {}, {}, {}};
  const auto convolve = [&](const MatrixXd& in, MatrixXd& to) {
    to = MatrixXd::Zero(samples + delay, in.cols());
    for (Index i = 0; i <= delay; ++i) {
      if (shaper.impulses[i] == 0) continue;
      to.topRows(i).rowwise() += shaper.impulses[i] * in.row(0);
      to.middleRows(i, samples) += shaper.impulses[i] * in;
      to.bottomRows(delay - i).rowwise() += shaper.impulses[i] * in.row(samples - 1);
    }
  };
  convolve(path.q, out.q);
  convolve(path.dq, out.dq);
  convolve(path.ddq, out.ddq);
  return out;
}

Move shaped(const Move& move, const Shaper& shaper) {
  Move out = move;
  out.reference = shaped(move.reference, shaper);
  out.stop += shaper.delay();
  return out;
}

double cut_short(const Reference& path, const Reference& after) {
  const auto reach = [](const MatrixXd& q) {
    MatrixXd ends(2, q.cols());
    ends << q.colwise().maxCoeff(), -q.colwise().minCoeff();
    return ends;
  };
  return std::max(0.0, (reach(path.q) - reach(after.q)).maxCoeff());
}

}  // namespace fxdyn
