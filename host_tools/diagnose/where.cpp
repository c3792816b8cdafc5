#include "host_tools/diagnose/where.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "host_tools/diagnose/shifted_residual.hpp"
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
  double from = 0, to = 0;
  double share = 0, of_time = 0;  ///< of the gap's power, of the samples
  std::string log{};              ///< empty: of all logs
  double contrast() const { return share - of_time; }
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

  /// The interval with the largest share of the power beyond its share of the samples.
  Region clearest(const std::string& signal, const VectorXd& power, double whole, double samples) const {
    Region best{signal};
    if (!(to_ > from_) || !(whole > 0)) return best;
    VectorXd of_class = VectorXd::Zero(bins);
    for (Index k = 0; k < power.size(); ++k) of_class[of_[static_cast<std::size_t>(k)]] += power[k];
    for (Index a = 0; a < bins; ++a) {
      double p = 0, c = 0;
      for (Index b = a; b < bins; ++b) {
        p += of_class[b];
        c += count_[b];
        if (p / whole - c / samples <= best.contrast()) continue;
        best.share = p / whole;
        best.of_time = c / samples;
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

/// One joint's motion and power above the noise at the rows of all logs.
struct Samples {
  VectorXd q, dq, ddq, load, t, power;
  std::vector<Index> first;  ///< row of each log
};

/// Takes the noise off: as much as the quietest half second has, at most.
void take_noise(const std::vector<const ProcessedLog*>& logs, Samples& samples, double noise) {
  double square = noise * noise;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const double row_s = logs[l]->step_s * static_cast<double>(logs[l]->decimation);
    const Index rows = logs[l]->rows(), stretch = std::max<Index>(1, static_cast<Index>(stretch_s / row_s));
    for (Index k = 0; k + stretch <= rows; k += stretch)
      square = std::min(square, samples.power.segment(samples.first[l] + k, stretch).mean());
  }
  samples.power.array() -= square;
}

/// The power at other times of each log: what has nothing to do with the motion. @param turn share of a log
VectorXd shifted(const Samples& samples, double turn) {
  VectorXd out(samples.power.size());
  for (std::size_t l = 0; l < samples.first.size(); ++l) {
    const Index first = samples.first[l];
    const Index rows = (l + 1 < samples.first.size() ? samples.first[l + 1] : out.size()) - first;
    shift(static_cast<Index>(turn * static_cast<double>(rows)), samples.power, {l, first, rows}, out);
  }
  return out;
}

/// The clearest interval of a signal, if the error at other times has none that is as clear.
std::optional<Region> concentrated(const std::string& signal, const VectorXd& values, const Samples& samples,
                                   double chance) {
  const Classes classes(values);
  const double whole = samples.power.sum();
  const auto count = static_cast<double>(values.size());
  const Region best = classes.clearest(signal, samples.power, whole, count);
  const int shifts = static_cast<int>(std::ceil(1 / chance)) - 1;
  for (int s = 1; s <= shifts; ++s) {
    const VectorXd other = shifted(samples, static_cast<double>(s) / (shifts + 1));
    if (classes.clearest(signal, other, whole, count).contrast() >= best.contrast()) return {};
  }
  return best;
}

Samples samples_of(const std::vector<const ProcessedLog*>& logs, std::size_t joint, const std::vector<VectorXd>& load,
                   const std::vector<VectorXd>& error) {
  const auto j = static_cast<Index>(joint);
  Index total = 0;
  for (const ProcessedLog* log : logs) total += log->rows();
  Samples out;
  for (VectorXd* v : {&out.q, &out.dq, &out.ddq, &out.load, &out.t, &out.power}) v->resize(total);
  Index row = 0;
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const ProcessedLog& log = *logs[l];
    out.first.push_back(row);
    const MotionRows m = log.joint_motion(j);
    for (Index r = 0; r < log.rows(); ++r, ++row) {
      const Index k = log.first + r * log.decimation;
      out.q[row] = m.q(k, 0);
      out.dq[row] = m.dq(k, 0);
      out.ddq[row] = m.ddq(k, 0);
      out.load[row] = load[l][k];
      out.t[row] = log.t[k];
      out.power[row] = error[l][k] * error[l][k];
    }
  }
  return out;
}

/// Clocks start anywhere: time is a log's own.
Region in_time(const std::vector<const ProcessedLog*>& logs, const Samples& samples) {
  Region best{"t"};
  for (std::size_t l = 0; l < logs.size(); ++l) {
    const Index first = samples.first[l], rows = logs[l]->rows();
    Region region = Classes(samples.t.segment(first, rows))
                        .clearest("t", samples.power.segment(first, rows), samples.power.sum(),
                                  static_cast<double>(samples.power.size()));
    if (logs.size() > 1) region.log = logs[l]->name;
    if (region.contrast() > best.contrast()) best = region;
  }
  return best;
}

/// Octaves of frequency, without a white noise of that size; their share of the band instead of that of time.
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
    const double share = std::min(1.0, power.segment(a, b - a).sum() / whole), of_band = (to - from) / cutoff;
    if (share - of_band > best.contrast()) best = {"frequency", from, to, share, of_band};
  }
  return best;
}

/// "at velocity -0.05 .. 0.05 rad/s"
std::string place_of(const GapRegion& region, const Joint& joint) {
  const std::string position = joint.position_unit();
  if (region.signal == "direction") return region.to > 0 ? "in positive direction" : "in negative direction";
  // three digits of the range's length: a range of seconds late in a log has to be told from its beginning
  const double length = region.to - region.from, largest = std::max(std::fabs(region.from), std::fabs(region.to));
  const int digits = length > 0 ? 3 + static_cast<int>(std::max(0.0, std::floor(std::log10(largest / length)))) : 3;
  const auto range = [&](const std::string& name, const std::string& unit) {
    return fmt::format("at {} {:.{}g} .. {:.{}g} {}", name, region.from, digits, region.to, digits, unit);
  };
  if (region.signal == "q") return range("position", position);
  if (region.signal == "dq") return range("velocity", position + "/s");
  if (region.signal == "ddq") return range("acceleration", position + "/s^2");
  if (region.signal == "load") return range("load", joint.torque_unit());
  if (region.signal == "frequency") return range("frequency", "Hz");
  return range("time", "s") + (region.log.empty() ? "" : " of " + region.log);
}

std::string sentence(const GapRegion& region, const Joint& joint) {
  std::string out = fmt::format("{:.0f} % of the gap is {}", 100 * *region.share_of_gap, place_of(region, joint));
  if (region.signal != "frequency") out += fmt::format(", {:.0f} % of the time", 100 * *region.share_of_time);
  return out;
}

}  // namespace

GapPlace where(const Joint& joint, std::size_t index, const std::vector<const ProcessedLog*>& logs,
               const std::vector<VectorXd>& load, const std::vector<VectorXd>& error, double noise,
               const ReportOptions& options) {
  Samples samples = samples_of(logs, index, load, error);
  take_noise(logs, samples, noise);
  std::vector<Region> regions;
  const auto add = [&](const std::string& signal, const VectorXd& values) {
    if (const auto region = concentrated(signal, values, samples, options.region_chance)) regions.push_back(*region);
  };
  add("dq", samples.dq);
  add("q", samples.q);
  add("ddq", samples.ddq);
  add("load", samples.load);
  add("direction", samples.dq.cwiseSign());
  if (!regions.empty() && regions.back().signal == "direction") {
    // All of one sign, not the edge of an interval.
    regions.back().to > 0 ? regions.back().from = 0 : regions.back().to = 0;
  }
  std::sort(regions.begin(), regions.end(),
            [](const Region& a, const Region& b) { return a.contrast() > b.contrast(); });
  // What has no place in the motion may have one in time, or in the spectrum.
  if (regions.empty()) regions.push_back(in_time(logs, samples));
  if (regions.front().contrast() < options.least_contrast) regions = {in_frequency(logs, error, noise)};
  GapPlace out;
  for (const Region& region : regions) {
    if (out.regions.size() >= most_regions || region.contrast() < options.least_contrast) break;
    out.regions.push_back(
        {region.signal, region.from, region.to, std::min(1.0, region.share), region.of_time, region.log});
  }
  out.sentence =
      out.regions.empty() ? "the gap is the same everywhere in these logs" : sentence(out.regions.front(), joint);
  return out;
}

}  // namespace fxdyn::diagnosis
