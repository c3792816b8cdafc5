#include "host_tools/regression/noise_cutoff.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "host_tools/signals/filter.hpp"
#include "host_tools/signals/spectrum.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double beyond_doubt = 2;  // standard deviations
constexpr double none = std::numeric_limits<double>::infinity();
constexpr double tau = 2 * std::numbers::pi;

/// Normal equations of one joint's torque over all logs: offset, sign, dq, q, ddq, torque.
struct Load {
  Eigen::Matrix<double, 6, 6> products = Eigen::Matrix<double, 6, 6>::Zero();
  double samples = 0;
  double inertia = 0, viscous = 0, torque_rms = 0;

  void add(const Log& log, Index joint, double band_hz) {
    const ZeroPhaseFilter filter(band_hz, log.step_s);
    const auto edge = std::min<Index>(log.samples() / 4, static_cast<Index>(1 / (band_hz * log.step_s)));
    const VectorXd q = filter.apply(log.q.col(joint));
    const VectorXd dq =
        log.dq.size() > 0 ? VectorXd(filter.apply(log.dq.col(joint))) : VectorXd(differentiate(q, log.step_s));
    MatrixXd columns(log.samples(), 6);
    columns << VectorXd::Ones(log.samples()), dq.array().sign().matrix(), dq, q, differentiate(dq, log.step_s),
        log.tau.col(joint);
    // What is not linear in the motion has frequencies above the band; the torque too. In place, column by column: a
    // long log is not held twice.
    for (Index c = 0; c < columns.cols(); ++c) columns.col(c) = filter.apply(columns.col(c));
    const auto rows = columns.middleRows(edge, log.samples() - 2 * edge);
    products += rows.transpose() * rows;
    samples += static_cast<double>(rows.rows());
  }

  void solve() {
    const Eigen::Matrix<double, 5, 5> normal = products.topLeftCorner<5, 5>();
    const Eigen::Vector<double, 5> scale = normal.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::Matrix<double, 5, 5> scaled = scale.asDiagonal() * normal * scale.asDiagonal();
    const Eigen::CompleteOrthogonalDecomposition<Eigen::Matrix<double, 5, 5>> inverse(scaled);
    const Eigen::Vector<double, 5> right = products.topRightCorner<5, 1>();
    const Eigen::Vector<double, 5> x = scale.cwiseProduct(inverse.solve(scale.cwiseProduct(right)));
    const double left = std::max(0.0, products(5, 5) - x.dot(right)) / samples;
    const Eigen::Matrix<double, 5, 5> spread = inverse.pseudoInverse();
    const auto sure = [&](Index i) {
      const double deviation = scale[i] * std::sqrt(std::max(0.0, spread(i, i)) * left);
      return std::fabs(x[i]) > beyond_doubt * deviation ? std::fabs(x[i]) : 0;
    };
    viscous = sure(2);
    inertia = sure(4);
    torque_rms = std::sqrt(products(5, 5) / samples);
  }
};

/// Largest density of white noise of the logs [unit^2 / Hz, one-sided].
double noise_density(const VectorXd& signal, double step_s) {
  const Spectrum spectrum = welch(signal, step_s);
  return std::pow(spectrum.noise_rms(), 2) / (0.5 / step_s);
}

/// Where the noise's torque reaches the limit: it grows with the cut-off, so that bisection finds it.
template <class MeanSquare>
double crossing(MeanSquare&& mean_square, double limit, double highest_hz) {
  double low = 0, high = highest_hz;
  if (!(mean_square(high) > limit * limit)) return none;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (mean_square(middle) > limit * limit ? high : low) = middle;
  }
  return low;
}

double joint_cutoff(const std::vector<Log>& logs, Index joint, double band_hz, double encoder_step) {
  Load load;
  double density = 0, rate = 0;
  bool measured = false;
  for (const Log& log : logs) {
    if (log.tau.size() == 0) continue;
    load.add(log, joint, band_hz);
    measured = log.dq.size() > 0;
    const VectorXd signal = measured ? log.dq.col(joint) : log.q.col(joint);
    density = std::max(density, noise_density(signal, log.step_s));
    if (!measured) density = std::max(density, encoder_step * encoder_step / 12 * 2 * log.step_s);
    rate = std::max(rate, 1 / log.step_s);
  }
  if (load.samples == 0) return none;
  load.solve();
  const double j2 = load.inertia * load.inertia * tau * tau, b2 = load.viscous * load.viscous;
  const auto of_velocity = [&](double f) { return density * (j2 * f * f * f / 3 + b2 * f); };
  const auto of_position = [&](double f) {
    return density * tau * tau * (j2 * std::pow(f, 5) / 5 + b2 * f * f * f / 3);
  };
  const double limit = noise_share * load.torque_rms;
  return measured ? crossing(of_velocity, limit, rate) : crossing(of_position, limit, rate);
}

}  // namespace

double noise_cutoff(const std::vector<Log>& logs, double band_hz, const std::vector<double>& encoder_step,
                    const std::vector<bool>& moves) {
  std::vector<double> cutoffs(encoder_step.size(), none);
  parallel_for(cutoffs.size(), [&](std::size_t j) {
    if (moves[j]) cutoffs[j] = joint_cutoff(logs, static_cast<Index>(j), band_hz, encoder_step[j]);
  });
  return *std::min_element(cutoffs.begin(), cutoffs.end());
}

}  // namespace fxdyn
