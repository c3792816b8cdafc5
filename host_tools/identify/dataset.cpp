#include "host_tools/identify/dataset.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host_tools/error.hpp"

namespace fxdyn {
namespace {

/// Frequency below which `share` of the power of the columns lies, at most `ceiling`. Goertzel sums on a coarse grid.
double power_frequency(const Eigen::MatrixXd& columns, double step_s, double share, double ceiling) {
  const Eigen::Index samples = columns.rows();
  const double resolution = std::max(1.0 / (static_cast<double>(samples) * step_s), ceiling / 400);
  const auto bins = static_cast<int>(ceiling / resolution);
  double highest = resolution;
  for (Eigen::Index j = 0; j < columns.cols(); ++j) {
    const Eigen::VectorXd x = columns.col(j).array() - columns.col(j).mean();
    std::vector<double> power;
    for (int bin = 1; bin <= bins; ++bin) {
      const double angle = 2 * std::numbers::pi * bin * resolution * step_s;
      double re = 0, im = 0;
      std::complex<double> phase = 1;
      const std::complex<double> turn = std::polar(1.0, angle);
      for (Eigen::Index k = 0; k < samples; ++k) {
        re += x[k] * phase.real();
        im += x[k] * phase.imag();
        phase *= turn;
      }
      power.push_back(re * re + im * im);
    }
    double total = 0, sum = 0;
    for (const double p : power) total += p;
    for (std::size_t bin = 0; bin < power.size(); ++bin) {
      sum += power[bin];
      if (sum >= share * total) {
        highest = std::max(highest, static_cast<double>(bin + 1) * resolution);
        break;
      }
    }
  }
  return highest;
}

}  // namespace

Eigen::MatrixXd ProcessedLog::filter_columns(const Eigen::Ref<const Eigen::MatrixXd>& full_rate) const {
  return ZeroPhaseFilter(filter.torque_cutoff_hz, step_s).apply(full_rate);
}

Eigen::MatrixXd ProcessedLog::decimate(const Eigen::Ref<const Eigen::MatrixXd>& filtered) const {
  Eigen::MatrixXd out(rows(), filtered.cols());
  for (Eigen::Index i = 0; i < out.rows(); ++i) out.row(i) = filtered.row(first + i * decimation);
  return out;
}

/// Whether velocity holds anything above the cut-off: noise, or motion that a filter would bend.
static bool is_noisy(const Eigen::MatrixXd& velocity, double cutoff_hz, double step_s) {
  const Eigen::MatrixXd above = velocity - ZeroPhaseFilter(cutoff_hz, step_s).apply(velocity);
  const Eigen::Index edge =
      std::min<Eigen::Index>(velocity.rows() / 4, static_cast<Eigen::Index>(2 / (cutoff_hz * step_s)));
  const Eigen::Index rows = velocity.rows() - 2 * edge;
  return above.middleRows(edge, rows).norm() > 1e-6 * velocity.middleRows(edge, rows).norm();
}

FilterFit choose_filter(const std::vector<Log>& logs, const SignalSettings& settings) {
  double excited = 0, rate = 1e30;
  std::vector<Eigen::MatrixXd> velocities;
  for (const Log& log : logs) {
    rate = std::min(rate, 1 / log.step_s);
    if (settings.position_cutoff_hz && settings.torque_cutoff_hz) continue;
    velocities.push_back(log.dq.size() > 0 ? log.dq : differentiate(log.q, log.step_s));
    excited = std::max(excited, power_frequency(velocities.back(), log.step_s, 0.999, std::min(30.0, 0.4 * rate)));
  }
  const double position = std::min(0.4 * rate, std::max(10 * excited, 10.0));
  bool noisy = false;
  for (std::size_t i = 0; i < velocities.size(); ++i) noisy |= is_noisy(velocities[i], position, logs[i].step_s);
  FilterFit filter;
  filter.position_cutoff_hz =
      settings.position_cutoff_hz.value_or(noisy ? position : rate / 2);  // half the rate: no filter
  filter.torque_cutoff_hz = settings.torque_cutoff_hz.value_or(std::min(0.4 * rate, std::max(5 * excited, 10.0)));
  filter.edge_s = settings.edge_s.value_or(3 / std::min(filter.torque_cutoff_hz, filter.position_cutoff_hz));
  return filter;
}

ProcessedLog process(const Log& log, const FilterFit& filter) {
  ProcessedLog out;
  out.name = log.file.filename().string();
  out.role = log.role;
  out.from_s = log.from_s;
  out.to_s = log.to_s;
  out.step_s = log.step_s;
  out.t = log.t;
  out.filter = filter;
  const ZeroPhaseFilter motion(filter.position_cutoff_hz, log.step_s);
  out.q = motion.apply(log.q);
  out.dq = log.dq.size() > 0 ? motion.apply(log.dq) : differentiate(out.q, log.step_s);
  out.ddq = log.ddq.size() > 0
                ? motion.apply(log.ddq)
                : (log.dq.size() > 0 ? differentiate(out.dq, log.step_s) : differentiate_twice(out.q, log.step_s));
  out.tau_raw = log.tau;
  if (log.tau.size() > 0) out.tau = out.filter_columns(log.tau);
  const auto edge = static_cast<Eigen::Index>(std::ceil(filter.edge_s / log.step_s));
  out.first = edge;
  out.last = log.samples() - edge;
  if (out.last - out.first < 10) {
    throw DataError(fmt::format(
        "{}: {:.2f} s from {} s is too short: {:.2f} s at either end go to the filters; take a longer window", out.name,
        static_cast<double>(log.samples()) * log.step_s, log.from_s, filter.edge_s));
  }
  const auto inside = [&](const Eigen::MatrixXd& m) { return m.middleRows(out.first, out.last - out.first); };
  out.q_range = (inside(out.q).colwise().maxCoeff() - inside(out.q).colwise().minCoeff()).transpose();
  const Eigen::MatrixXd taken = inside(log.q) - inside(out.q);
  out.q_noise = (taken.colwise().norm() / std::sqrt(static_cast<double>(taken.rows()))).transpose();
  // Eight samples a period of the cut-off lose nothing and spare work.
  out.decimation = std::max<Eigen::Index>(1, static_cast<Eigen::Index>(1 / (log.step_s * 8 * filter.torque_cutoff_hz)));
  return out;
}

Eigen::VectorXd noise_floor(const ProcessedLog& log) {
  const Eigen::MatrixXd above = (log.tau_raw - log.tau).middleRows(log.first, log.last - log.first);
  const double nyquist = 0.5 / log.step_s, kept = std::min(log.filter.torque_cutoff_hz, 0.95 * nyquist);
  const double scale = std::sqrt(kept / (nyquist - kept));
  return scale * (above.colwise().norm() / std::sqrt(static_cast<double>(above.rows()))).transpose();
}

}  // namespace fxdyn
