#include "host_tools/diagnose/where.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/effects/evaluator.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/signals/spectrum.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr Index bins = 24;
constexpr std::size_t most_regions = 4;

struct Region {
  std::string signal;
  double from = 0, to = 0, share = 0, contrast = 0;
  std::string log{};  ///< empty: of all logs
};

/// What shares are of: the gap's power, and samples.
struct Whole {
  double power = 0, samples = 0;
};

/// The interval with the largest share of the gap beyond its share of the samples.
Region concentrated(const std::string& signal, const VectorXd& values, const VectorXd& square, double noise,
                    const Whole& of) {
  Region best{signal};
  std::vector<double> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  const double from = sorted[sorted.size() / 200], to = sorted[sorted.size() - 1 - sorted.size() / 200];
  if (!(to > from)) return best;
  VectorXd power = VectorXd::Zero(bins), count = VectorXd::Zero(bins);
  for (Index k = 0; k < values.size(); ++k) {
    const auto bin = std::clamp<Index>(static_cast<Index>((values[k] - from) / (to - from) * bins), 0, bins - 1);
    power[bin] += square[k] - noise * noise;
    count[bin] += 1;
  }
  if (!(of.power > 0)) return best;
  for (Index a = 0; a < bins; ++a) {
    double p = 0, c = 0;
    for (Index b = a; b < bins; ++b) {
      p += power[b];
      c += count[b];
      const double contrast = p / of.power - c / of.samples;
      if (contrast <= best.contrast) continue;
      best.contrast = contrast;
      best.share = std::min(1.0, p / of.power);
      best.from = from + (to - from) * static_cast<double>(a) / bins;
      best.to = from + (to - from) * static_cast<double>(b + 1) / bins;
    }
  }
  return best;
}

/// One joint's motion and squared error at the rows of all logs.
struct Samples {
  VectorXd q, dq, ddq, load, t, square;
};

Samples samples_of(const IdentifiedModel& model, const std::vector<const ProcessedLog*>& logs, std::size_t joint,
                   const std::vector<VectorXd>& error) {
  const auto j = static_cast<Index>(joint);
  Index total = 0;
  for (const ProcessedLog* log : logs) total += log->rows();
  Samples out;
  for (VectorXd* v : {&out.q, &out.dq, &out.ddq, &out.load, &out.t, &out.square}) v->resize(total);
  IdentifiedModel rigid = model;
  for (JointFit& fit : rigid.joints) {
    fit.effects.clear();
    fit.bls.reset();
  }
  Index row = 0;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const ProcessedLog& log = *logs[l];
    const MotionRows m = log.joint_motion(j);
    const VectorXd structural = predict(rigid, log).col(j);
    for (Index r = 0; r < log.rows(); ++r, ++row) {
      const Index k = log.first + r * log.decimation;
      out.q[row] = m.q(k, 0);
      out.dq[row] = m.dq(k, 0);
      out.ddq[row] = m.ddq(k, 0);
      out.load[row] = structural[k];
      out.t[row] = log.t[k];
      out.square[row] = error[l][k] * error[l][k];
    }
  }
  return out;
}

/// Clocks start anywhere: time is a log's own.
Region in_time(const std::vector<const ProcessedLog*>& logs, const Samples& samples, double noise, const Whole& all) {
  Region best{"t"};
  Index first = 0;
  for (const ProcessedLog* log : logs) {
    Region region = concentrated("t", samples.t.segment(first, log->rows()), samples.square.segment(first, log->rows()),
                                 noise, all);
    if (logs.size() > 1) region.log = log->name;
    if (region.contrast > best.contrast) best = region;
    first += log->rows();
  }
  return best;
}

/// Direction of motion, as -1..0 or 0..1; an empty interval: there is no gap.
Region in_direction(const Samples& samples, double noise) {
  double forward = 0, backward = 0, ahead = 0;
  for (Index k = 0; k < samples.dq.size(); ++k) {
    (samples.dq[k] > 0 ? forward : backward) += samples.square[k] - noise * noise;
    ahead += samples.dq[k] > 0;
  }
  const double whole = forward + backward, share = ahead / static_cast<double>(std::max<Index>(samples.dq.size(), 1));
  if (!(whole > 0)) return {"direction"};
  const bool positive = forward / whole - share > 0;
  const double mine = positive ? forward / whole : backward / whole;
  return {"direction", positive ? 0.0 : -1.0, positive ? 1.0 : 0.0, std::min(1.0, mine),
          mine - (positive ? share : 1 - share)};
}

/// Octaves of frequency, without a white noise of that size; contrast against the band.
Region in_frequency(const std::vector<const ProcessedLog*>& logs, const std::vector<VectorXd>& error, double noise) {
  const double cutoff = logs.front()->filter.torque_cutoff_hz;
  VectorXd power;
  double step = 0;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const ProcessedLog& log = *logs[l];
    const Spectrum spectrum = welch(error[l].segment(log.first, log.last - log.first), log.step_s);
    if (power.size() == 0) power = VectorXd::Zero(spectrum.density.size());
    if (power.size() != spectrum.density.size()) continue;
    power += spectrum.density * static_cast<double>(log.rows());
    step = spectrum.frequency(1) - spectrum.frequency(0);
    const auto inside = std::min<Index>(power.size(), static_cast<Index>(cutoff / step));
    power.head(inside).array() -= noise * noise / cutoff * static_cast<double>(log.rows());
  }
  const double whole = power.sum();
  Region best{"frequency"};
  for (double from = 0; from < cutoff && whole > 0 && step > 0; from = std::max(2 * from, 0.5)) {
    const double to = std::max(2 * from, 0.5);
    const auto a = static_cast<Index>(from / step), b = std::min<Index>(power.size(), static_cast<Index>(to / step));
    if (b <= a) continue;
    const double share = std::min(1.0, power.segment(a, b - a).sum() / whole), contrast = share - (to - from) / cutoff;
    if (contrast > best.contrast) best = {"frequency", from, to, share, contrast};
  }
  return best;
}

}  // namespace

std::vector<GapRegion> where(const IdentifiedModel& model, const std::vector<const ProcessedLog*>& logs,
                             std::size_t joint, const std::vector<VectorXd>& error, double noise,
                             const ReportOptions& options) {
  const Samples samples = samples_of(model, logs, joint, error);
  const auto total = static_cast<double>(samples.square.size());
  const Whole all{samples.square.sum() - noise * noise * total, total};
  std::vector<Region> regions;
  const auto add = [&](Region region) {
    if (region.share > 0) regions.push_back(std::move(region));
  };
  add(concentrated("dq", samples.dq, samples.square, noise, all));
  add(concentrated("q", samples.q, samples.square, noise, all));
  add(concentrated("ddq", samples.ddq, samples.square, noise, all));
  add(concentrated("load", samples.load, samples.square, noise, all));
  add(in_time(logs, samples, noise, all));
  if (const Region region = in_direction(samples, noise); region.to > region.from) regions.push_back(region);
  add(in_frequency(logs, error, noise));
  std::sort(regions.begin(), regions.end(), [](const Region& a, const Region& b) { return a.contrast > b.contrast; });
  std::vector<GapRegion> out;
  for (const Region& region : regions) {
    if (out.size() >= most_regions || (region.contrast < options.least_contrast && !out.empty())) break;
    out.push_back({region.signal, region.from, region.to, region.share, region.log});
  }
  return out;
}

}  // namespace fxdyn::diagnosis
