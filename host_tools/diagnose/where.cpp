#include "host_tools/diagnose/where.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <unsupported/Eigen/FFT>

#include "host_tools/diagnose/shifted_residual.hpp"
#include "host_tools/diagnose/where_words.hpp"
#include "host_tools/signals/spectrum.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr Index bins = 24;
constexpr std::size_t most_regions = 4;
/// Seconds whose mean error is the quietest of a log's.
constexpr double stretch_s = 0.5;

/// A region, as it is compared with others.
struct Region {
  std::string signal;
  std::size_t joint = 0;  ///< whose position it is, from 1; 0: of the joint itself
  double from = 0, to = 0;
  double share = 0, of_time = 0;  ///< of the gap's power, of the samples
  std::string log{};              ///< empty: of all logs
  double contrast() const { return share - of_time; }
  /// Log likelihood ratio of a scan statistic, per unit of power: share ln(share / of_time) + the same of the rest
  /// (Kulldorff, "A spatial scan statistic", Comm. Statist. Theory Methods 26, 1997). Of two regions with one contrast
  /// the narrower one is the clearer.
  double evidence() const {
    const auto term = [](double a, double b) { return a > 0 ? a * std::log(a / b) : 0; };
    const double inside = std::min(share, 1.0);
    return inside > of_time && of_time > 0 ? term(inside, of_time) + term(1 - inside, 1 - of_time) : 0;
  }
};

/// Values of a signal in classes of equal width, without the outermost half per cent.
class Classes {
 public:
  explicit Classes(const VectorXd& values) : count_(VectorXd::Zero(bins)) {
    std::vector<double> sorted(values.begin(), values.end());
    std::sort(sorted.begin(), sorted.end());
    from_ = sorted[sorted.size() / 200];
    to_ = sorted[sorted.size() - 1 - sorted.size() / 200];
    of_.reserve(sorted.size());
    for (const double value : values) {
      const double place = to_ > from_ ? (value - from_) / (to_ - from_) * bins : 0;
      of_.push_back(std::clamp<Index>(static_cast<Index>(place), 0, bins - 1));
      count_[of_.back()] += 1;
    }
  }

  double from() const { return from_; }

  /// The interval with the largest share of the power beyond its share of the samples.
  Region clearest(const VectorXd& power, double whole, double samples) const {
    Region best;
    if (!(to_ > from_) || !(whole > 0)) return best;
    VectorXd of_class = VectorXd::Zero(bins);
    for (Index k = 0; k < power.size(); ++k) of_class[of_[static_cast<std::size_t>(k)]] += power[k];
    for (Index a = 0; a < bins; ++a) {
      double p = 0, c = 0;
      for (Index b = a; b < bins; ++b) {
        p += of_class[b];
        c += count_[b];
        const Region region{"", 0, 0, 0, p / whole, c / samples};
        if (region.evidence() <= best.evidence()) continue;
        best.share = region.share;
        best.of_time = region.of_time;
        best.from = from_ + (to_ - from_) * static_cast<double>(a) / bins;
        best.to = from_ + (to_ - from_) * static_cast<double>(b + 1) / bins;
      }
    }
    return best;
  }

 private:
  double from_ = 0, to_ = 0;
  std::vector<Index> of_;
  VectorXd count_;
};

/// A signal of the motion, in which a region may lie.
struct Signal {
  std::string name;
  std::size_t joint = 0;  ///< as in Region
  VectorXd values;
};

/// Motion and one joint's power above the noise at the rows of all logs.
struct Samples {
  std::vector<Signal> signals;
  VectorXd t, error, power;
  std::vector<Index> first;  ///< row of each log
  double noise_square = 0;   ///< taken off the power
  Index rows(std::size_t log) const { return (log + 1 < first.size() ? first[log + 1] : power.size()) - first[log]; }
};

/// Takes the noise off: as much as the quietest half second has, at most.
void take_noise(const std::vector<const ProcessedLog*>& logs, Samples& samples, double noise) {
  samples.power = samples.error.cwiseAbs2();
  double square = noise * noise;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const double row_s = logs[l]->step_s * static_cast<double>(logs[l]->decimation);
    const Index rows = logs[l]->rows(), stretch = std::max<Index>(1, static_cast<Index>(stretch_s / row_s));
    for (Index k = 0; k + stretch <= rows; k += stretch)
      square = std::min(square, samples.power.segment(samples.first[l] + k, stretch).mean());
  }
  samples.power.array() -= square;
  samples.noise_square = square;
}

/// The power at other times of each log: what has nothing to do with the motion. @param turn share of a log
VectorXd shifted(const Samples& samples, double turn) {
  VectorXd out(samples.power.size());
  for (std::size_t l = 0; l < samples.first.size(); ++l) {
    const Index rows = samples.rows(l);
    shift(static_cast<Index>(turn * static_cast<double>(rows)), samples.power, {l, samples.first[l], rows}, out);
  }
  return out;
}

int draws_for(double chance) { return static_cast<int>(std::ceil(1 / chance)) - 1; }

/// The clearest interval of each signal, of those that are clearer than any interval of any signal that the error has
/// at other times: all intervals tried are paid for at once.
std::vector<Region> in_motion(const Samples& samples, double chance) {
  const double whole = samples.power.sum();
  const auto count = static_cast<double>(samples.power.size());
  std::vector<Classes> classes;
  std::vector<Region> regions;
  for (const Signal& signal : samples.signals) {
    classes.emplace_back(signal.values);
    Region region = classes.back().clearest(samples.power, whole, count);
    region.signal = signal.name;
    region.joint = signal.joint;
    // The slowest class has all that is slower, too.
    if (signal.name == "speed" && region.from <= classes.back().from()) region.from = 0;
    regions.push_back(region);
  }
  double by_chance = 0;
  const int draws = draws_for(chance);
  for (int s = 1; s <= draws; ++s) {
    const VectorXd other = shifted(samples, static_cast<double>(s) / (draws + 1));
    for (const Classes& of : classes) by_chance = std::max(by_chance, of.clearest(other, whole, count).evidence());
  }
  std::erase_if(regions, [&](const Region& r) { return r.evidence() <= by_chance; });
  return regions;
}

/// A signal's values at the rows of all logs. @param of one log and its index to the signal at full rate
template <class Of>
VectorXd at_rows(const std::vector<const ProcessedLog*>& logs, Of of) {
  std::vector<double> out;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const ProcessedLog& log = *logs[l];
    const VectorXd values = of(log, l);
    for (Index r = 0; r < log.rows(); ++r) out.push_back(values[log.first + r * log.decimation]);
  }
  return Eigen::Map<const VectorXd>(out.data(), static_cast<Index>(out.size()));
}

Samples samples_of(const std::vector<const ProcessedLog*>& logs, std::size_t joint, const std::vector<VectorXd>& load,
                   const std::vector<VectorXd>& error) {
  const auto own = static_cast<Index>(joint);
  Samples out;
  Index row = 0;
  for (const ProcessedLog* log : logs) {
    out.first.push_back(row);
    row += log->rows();
  }
  out.t = at_rows(logs, [](const ProcessedLog& log, std::size_t) { return log.t; });
  out.error = at_rows(logs, [&](const ProcessedLog&, std::size_t l) { return error[l]; });
  const auto position = [&](Index j) {
    return at_rows(logs,
                   [j](const ProcessedLog& log, std::size_t) -> VectorXd { return log.joint_motion(j).q.col(0); });
  };
  const VectorXd dq = at_rows(
      logs, [own](const ProcessedLog& log, std::size_t) -> VectorXd { return log.joint_motion(own).dq.col(0); });
  const VectorXd ddq = at_rows(
      logs, [own](const ProcessedLog& log, std::size_t) -> VectorXd { return log.joint_motion(own).ddq.col(0); });
  out.signals = {{"dq", 0, dq},
                 {"speed", 0, dq.cwiseAbs()},
                 {"q", 0, position(own)},
                 {"ddq", 0, ddq},
                 {"load", 0, at_rows(logs, [&](const ProcessedLog&, std::size_t l) { return load[l]; })},
                 {"direction", 0, dq.cwiseSign()}};
  for (Index j = 0; j < logs.front()->q.cols(); ++j)
    if (j != own) out.signals.push_back({"q", static_cast<std::size_t>(j + 1), position(j)});
  return out;
}

/// The largest length up to `rows` without prime factors beyond 5, which the transform is slow with: at most a few per
/// cent are left over.
Index quick_length(Index rows) {
  for (Index length = rows; length > 1; --length) {
    Index rest = length;
    for (const Index prime : {2, 3, 5}) {
      while (rest % prime == 0) rest /= prime;
    }
    if (rest == 1) return length;
  }
  return 1;
}

/// An error of the same spectrum in each log, and the same everywhere: its lines with phases drawn at random.
VectorXd stationary(const Samples& samples, Random& random) {
  VectorXd out(samples.error.size());
  Eigen::FFT<double> fft;
  for (std::size_t l = 0; l < samples.first.size(); ++l) {
    const Index first = samples.first[l], rows = samples.rows(l);
    const Index length = quick_length(rows);
    std::vector<double> x(samples.error.data() + first, samples.error.data() + first + length);
    std::vector<std::complex<double>> lines;
    fft.fwd(lines, x);
    for (std::size_t k = 1; 2 * k < lines.size(); ++k) {
      lines[k] = std::polar(std::abs(lines[k]), random.uniform(0, 2 * std::numbers::pi));
      lines[lines.size() - k] = std::conj(lines[k]);
    }
    fft.inv(x, lines);
    for (Index r = 0; r < rows; ++r) out[first + r] = x[static_cast<std::size_t>(r % length)];
  }
  return out;
}

/// Clocks start anywhere: time is a log's own.
Region clearest_in_time(const std::vector<const ProcessedLog*>& logs, const Samples& samples, const VectorXd& power) {
  Region best;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const Index first = samples.first[l], rows = samples.rows(l);
    Region region = Classes(samples.t.segment(first, rows))
                        .clearest(power.segment(first, rows), power.sum(), static_cast<double>(power.size()));
    region.signal = "t";
    if (logs.size() > 1) region.log = logs[l]->name;
    if (region.evidence() > best.evidence()) best = region;
  }
  return best;
}

/// The clearest interval of time, if an error that is the same everywhere has none that is as clear.
std::vector<Region> in_time(const std::vector<const ProcessedLog*>& logs, const Samples& samples, double chance) {
  const Region best = clearest_in_time(logs, samples, samples.power);
  Random random(1);
  for (int draw = 0; draw < draws_for(chance); ++draw) {
    const VectorXd power = stationary(samples, random).cwiseAbs2().array() - samples.noise_square;
    if (clearest_in_time(logs, samples, power).evidence() >= best.evidence()) return {};
  }
  return {best};
}

/// Power by frequency of what each log has of it, up to the torque's cut-off.
struct Octaves {
  VectorXd power;
  double step_hz = 0;
  double share(double from, double to) const {
    const auto a = static_cast<Index>(from / step_hz);
    const auto b = std::min<Index>(power.size(), static_cast<Index>(to / step_hz));
    const double whole = power.sum();
    return b > a && whole > 0 ? std::min(1.0, power.segment(a, b - a).sum() / whole) : 0;
  }
};

/// @param noise RMS of a white noise below the cut-off that is no part of it
Octaves octaves_of(const std::vector<const ProcessedLog*>& logs, const std::vector<VectorXd>& signal, double noise) {
  const double cutoff = logs.front()->filter.torque_cutoff_hz;
  Octaves out;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const ProcessedLog& log = *logs[l];
    const Spectrum spectrum = welch(signal[l].segment(log.first, log.last - log.first), log.step_s);
    if (out.power.size() == 0) out.power = VectorXd::Zero(spectrum.density.size());
    if (out.power.size() != spectrum.density.size()) continue;
    out.step_hz = spectrum.frequency(1) - spectrum.frequency(0);
    const auto inside = std::min<Index>(out.power.size(), static_cast<Index>(cutoff / out.step_hz));
    VectorXd power = spectrum.density.head(inside).array() - noise * noise / cutoff;
    out.power.head(inside) += power * static_cast<double>(log.rows());
  }
  return out;
}

/// The octave that has more of the gap than of the load, by most: its share of that instead of that of time.
Region in_frequency(const std::vector<const ProcessedLog*>& logs, const std::vector<VectorXd>& error,
                    const std::vector<VectorXd>& load, double noise) {
  const double cutoff = logs.front()->filter.torque_cutoff_hz;
  const Octaves gap = octaves_of(logs, error, noise), motion = octaves_of(logs, load, 0);
  Region best;
  best.signal = "frequency";
  for (double from = 0; from < cutoff && gap.step_hz > 0; from = std::max(2 * from, 0.5)) {
    const double to = std::max(2 * from, 0.5);
    const Region region{"frequency", 0, from, to, gap.share(from, to), motion.share(from, to)};
    if (region.contrast() > best.contrast()) best = region;
  }
  return best;
}

/// Times of the session's clock, or of one log's: then the others' are none.
VectorXd times_of(const std::vector<const ProcessedLog*>& logs, const Samples& samples, const std::string& log) {
  VectorXd out = samples.t;
  for (std::size_t l = 0; l < logs.size() && !log.empty(); ++l) {
    if (logs[l]->name != log) out.segment(samples.first[l], samples.rows(l)).setConstant(std::nan(""));
  }
  return out;
}

/// How much of the gap, and of the time, is at the place of a curve; nothing where the signal is not here.
std::vector<Region> measured(const std::vector<const ProcessedLog*>& logs, const Samples& samples,
                             const std::optional<GapRegion>& place) {
  const double whole = samples.power.sum();
  if (!place || !(whole > 0)) return {};
  const auto at = [&](const VectorXd& values) -> std::vector<Region> {
    const Eigen::ArrayXd within = (values.array() >= place->from && values.array() <= place->to).cast<double>();
    Region out{place->signal, place->joint, place->from, place->to, 0, within.mean(), place->log};
    out.share = std::min(1.0, (samples.power.array() * within).sum() / whole);
    return {out};
  };
  if (place->signal == "t") return at(times_of(logs, samples, place->log));
  for (const Signal& signal : samples.signals) {
    if (signal.name == place->signal && signal.joint == place->joint) return at(signal.values);
  }
  return {};
}

}  // namespace

GapPlace where(const Robot& robot, std::size_t index, const std::vector<const ProcessedLog*>& logs,
               const std::vector<VectorXd>& load, const std::vector<VectorXd>& error, double noise,
               const ReportOptions& options, const std::optional<GapRegion>& of_curve) {
  Samples samples = samples_of(logs, index, load, error);
  take_noise(logs, samples, noise);
  std::vector<Region> regions = in_motion(samples, options.region_chance);
  for (Region& region : regions) {
    // All of one sign, not the edge of an interval.
    // Rows at rest may have come along.
    if (region.signal == "direction")
      region = {
          region.signal,  0,         region.from < -0.5 ? -1.0 : 0.0, region.from < -0.5 ? 0.0 : 1.0, region.share,
          region.of_time, region.log};
  }
  const auto drop_faint = [&] {
    std::erase_if(regions, [&](const Region& r) { return r.contrast() < options.least_contrast; });
  };
  drop_faint();
  // What another joint's position explains, its own motion may explain as well: the joint's own is told first.
  std::sort(regions.begin(), regions.end(), [&](const Region& a, const Region& b) {
    const auto rank = [&](const Region& r) { return r.evidence() * (r.joint > 0 ? 1 - options.other_joint : 1); };
    return rank(a) > rank(b);
  });
  const auto or_else = [&](const auto& others) {
    if (!regions.empty()) return;
    regions = others();
    drop_faint();
  };
  or_else([&] { return measured(logs, samples, of_curve); });
  or_else([&] { return in_time(logs, samples, options.region_chance); });
  or_else([&] { return std::vector<Region>{in_frequency(logs, error, load, noise)}; });
  GapPlace out;
  for (const Region& region : regions) {
    if (out.regions.size() >= most_regions) break;
    out.regions.push_back(
        {region.signal, region.joint, region.from, region.to, std::min(1.0, region.share), region.of_time, region.log});
  }
  out.sentence = sentence_of(out.regions, robot, index, logs);
  return out;
}

}  // namespace fxdyn::diagnosis
