#include "host_tools/diagnose/ripples.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "host_tools/diagnose/dictionary.hpp"
#include "host_tools/effects/effects.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// A residual over the angle of its joint.
struct OverAngle {
  std::vector<double> q, g;   ///< angle [rad | m] and g there
  std::vector<double> at;     ///< how fast the joint is there [rad/s | m/s]; infinite where a log begins
  std::vector<double> speed;  ///< of every row [rad/s | m/s]
  double cutoff_hz = 0;       ///< of the torque
};

/// The adjoint of whitening on the rows of one log.
VectorXd coloured_back(const VectorXd& e, const VectorXd& a) {
  VectorXd w = e;
  for (Index lag = 1; lag <= a.size() && lag < e.size(); ++lag)
    w.head(e.size() - lag) -= a[lag - 1] * e.tail(e.size() - lag);
  return w;
}

OverAngle over_angle(const Linearised& problem, std::size_t joint, const VectorXd& residual) {
  OverAngle out;
  const auto j = static_cast<Index>(joint);
  out.cutoff_hz = problem.logs().front().log.filter.torque_cutoff_hz;
  for (std::size_t l = 0; l < problem.logs().size(); ++l) {
    const SessionLog& entry = problem.logs()[l];
    if (entry.healthy || !entry.fits) continue;
    const ProcessedLog& log = entry.log;
    const Block& b = problem.blocks().of_log[l];
    const VectorXd w = coloured_back(residual.segment(b.first, b.count), problem.noise().whitening()[joint]);
    VectorXd full = VectorXd::Zero(log.samples());
    for (Index r = 0; r < b.count; ++r) full[log.first + r * log.decimation] = w[r];
    full = log.filter_columns(full);
    const auto& motion = problem.motion(l);
    // exp(i n q) g lives below the cut-off wherever the filter lets the ripple through
    const auto stride = std::max<Index>(1, whole(1 / (log.step_s * 6 * out.cutoff_hz)));
    for (Index k = log.first; k < log.last; k += stride) {
      out.q.push_back(motion.q(k, j));
      out.g.push_back(full[k] * static_cast<double>(stride));
      out.at.push_back(k == log.first ? unbounded : std::fabs(motion.dq(k, j)));
    }
    for (Index r = 0; r < b.count; ++r) out.speed.push_back(std::fabs(motion.dq(log.first + r * log.decimation, j)));
  }
  return out;
}

/// Power of a ripple of amplitude 1 after filter, decimation and whitening, by wavenumber: how fast the joint passes it
/// decides its frequency.
class ExpectedPower {
 public:
  ExpectedPower(const Linearised& problem, std::size_t joint, std::vector<double> speed)
      : whitening_(problem.noise().whitening()[joint]),
        cutoff_hz_(problem.logs().front().log.filter.torque_cutoff_hz),
        interval_s_(problem.logs().front().log.step_s * static_cast<double>(problem.logs().front().log.decimation)),
        rows_(static_cast<double>(speed.size())) {
    std::sort(speed.begin(), speed.end());
    for (std::size_t i = 0; i < classes; ++i) speeds_.push_back(speed[(2 * i + 1) * speed.size() / (2 * classes)]);
  }

  double operator()(double n) const {
    double sum = 0;
    for (const double v : speeds_) {
      const double f = n * v / (2 * std::numbers::pi);
      const double h = 1 / (1 + std::pow(f / cutoff_hz_, 8));
      std::complex<double> white = 1;
      for (Index lag = 1; lag <= whitening_.size(); ++lag)
        white -=
            whitening_[lag - 1] * std::polar(1.0, -2 * std::numbers::pi * f * interval_s_ * static_cast<double>(lag));
      sum += h * h * std::norm(white);
    }
    return 0.5 * sum / static_cast<double>(classes) * rows_;
  }

 private:
  static constexpr std::size_t classes = 64;
  const VectorXd& whitening_;
  double cutoff_hz_, interval_s_, rows_;
  std::vector<double> speeds_;  ///< one a class, as many rows in each
};

struct Spectrum {
  std::vector<double> n, p;
};

/// Whether the joint goes through two periods of a wave somewhere, slow enough for the filter to let it through, or is
/// never too fast for that. What does not come back is no period: it is a torque at a reversal, of any form.
bool comes_back(const OverAngle& data, double fastest, double n) {
  const double slow = 2 * std::numbers::pi * data.cutoff_hz / n, periods = 2 * 2 * std::numbers::pi / n;
  if (fastest <= slow) return true;
  double low = 0, high = 0;
  bool within = false;
  for (std::size_t k = 0; k < data.q.size(); ++k) {
    const bool was = std::exchange(within, data.at[k] <= slow);
    if (!within) continue;
    low = was ? std::min(low, data.q[k]) : data.q[k];
    high = was ? std::max(high, data.q[k]) : data.q[k];
    if (high - low >= periods) return true;
  }
  return false;
}

/// From `lowest` on in steps, as far as the filter lets a ripple through.
Spectrum spectrum_of(const OverAngle& data, const ExpectedPower& power, double lowest, double step) {
  constexpr std::size_t most_wavenumbers = 2400;
  const double floor = 2e-3 * power(lowest);
  const double base_power = power(lowest);
  std::vector<std::complex<double>> turn(data.q.size()), at_n(data.q.size());
  for (std::size_t k = 0; k < data.q.size(); ++k) {
    turn[k] = std::polar(1.0, step * data.q[k]);
    at_n[k] = data.g[k] * std::polar(1.0, lowest * data.q[k]);
  }
  Spectrum out;
  for (std::size_t i = 0; i < most_wavenumbers; ++i) {
    const double number = lowest + step * static_cast<double>(i), expected = power(number);
    if (expected < floor) break;
    std::complex<double> sum = 0;
    for (std::size_t k = 0; k < data.q.size(); ++k) {
      sum += at_n[k];
      at_n[k] *= turn[k];
    }
    out.n.push_back(number);
    // What is faint only because the filter takes it away must not win by that.
    out.p.push_back(std::norm(sum) / (2 * std::max(expected, 1e-2 * base_power)));
  }
  return out;
}

/// The highest first.
std::vector<std::size_t> peaks_of(const std::vector<double>& p) {
  std::vector<std::size_t> peaks;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const bool peak = (i == 0 || p[i] >= p[i - 1]) && (i + 1 == p.size() || p[i] > p[i + 1]);
    if (peak) peaks.push_back(i);
  }
  std::sort(peaks.begin(), peaks.end(), [&](std::size_t x, std::size_t y) { return p[x] > p[y]; });
  return peaks;
}

}  // namespace

std::vector<Group> ripples(const Linearised& problem, std::size_t joint, const VectorXd& residual, std::size_t most) {
  const double range = scales_of(problem, joint).range;
  const auto& infos = effect_infos();
  const auto info = std::find_if(infos.begin(), infos.end(), [](const EffectInfo& one) { return one.of_spectrum(); });
  if (!(range > 0) || info == infos.end()) return {};
  const OverAngle data = over_angle(problem, joint, residual);
  const double fastest = *std::max_element(data.speed.begin(), data.speed.end());
  const double cell = 2 * std::numbers::pi / range, step = cell / 4;
  const double lowest = std::max(info->shape[0].lower, std::max(0.6 * cell, 1.3 * std::min(1.0, 6.0 / range)));
  const Spectrum spectrum = spectrum_of(data, ExpectedPower(problem, joint, data.speed), lowest, step);
  std::vector<Group> out;
  for (const std::size_t i : peaks_of(spectrum.p)) {
    if (out.size() == most) break;
    if (!comes_back(data, fastest, spectrum.n[i])) continue;
    Group group;
    group.candidate = {std::string(info->name), joint, {spectrum.n[i]}};
    group.nonlinear = 1;
    group.log_grid = std::log(std::max(1.0, static_cast<double>(spectrum.p.size()) / 4));
    group.lower = {-unbounded, -unbounded};
    out.push_back(std::move(group));
  }
  return out;
}

}  // namespace fxdyn::diagnosis
