#include "host_tools/diagnose/time_structure.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <unsupported/Eigen/FFT>

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// A numeric choice: bins whose median is a line's level; odd.
constexpr Index neighbours = 31;

struct Line {
  double power, level;
};

/// Lines of one periodogram, each with the level of its neighbourhood.
void add_lines(const VectorXd& power, std::vector<Line>& lines) {
  const Index bins = power.size();
  for (Index k = 0; k < bins; ++k) {
    const Index n = std::min(neighbours, bins), from = std::clamp<Index>(k - n / 2, 0, bins - n);
    VectorXd near = power.segment(from, n);
    std::nth_element(near.begin(), near.begin() + n / 2, near.end());
    const double level = near[n / 2] / std::numbers::ln2;
    if (level > 0) lines.push_back({power[k], level});
  }
}

/// The level is itself a median of so many: of n exponential variables the chance of c times the median is
/// prod k / (k + c), k from the middle to n. Times the number of lines.
double chance_of(const Line& line, double count) {
  double p = count;
  for (Index k = (neighbours + 1) / 2; k <= neighbours; ++k) {
    const auto n = static_cast<double>(k);
    p *= n / (n + line.power / (line.level * std::numbers::ln2));
  }
  return p;
}

}  // namespace

double chance(double ratio, double freedom, double other) {
  const double a = 2 / (9 * freedom), b = 2 / (9 * other), root = std::cbrt(ratio);
  const double z = ((1 - b) * root - (1 - a)) / std::sqrt(b * root * root + a);
  return 0.5 * std::erfc(z / std::numbers::sqrt2);
}

namespace {

/// Blocks that follow one another in a log as one: the longer, the slower a line may be.
std::vector<Block> joined(const Blocks& blocks, const std::vector<std::size_t>& of) {
  std::vector<Block> out;
  for (const std::size_t i : of) {
    const Block& b = blocks.all[i];
    const bool follows = !out.empty() && out.back().log == b.log && out.back().first + out.back().count == b.first;
    if (follows) {
      out.back().count += b.count;
    } else {
      out.push_back(b);
    }
  }
  return out;
}

}  // namespace

TimeStructure spectral_lines(const std::vector<SessionLog>& logs, const Blocks& blocks, const VectorXd& e,
                             const std::vector<std::size_t>& of, const LackOfFitOptions& options) {
  std::vector<Line> lines;
  double whole = 0;
  Eigen::FFT<double> fft;
  for (const Block& b : joined(blocks, of)) {
    const ProcessedLog& log = logs[b.log].log;
    const double seconds = static_cast<double>(b.count * log.decimation) * log.step_s;
    // Towards the cut-off the filter's slope is no line.
    const auto bins =
        std::min(b.count / 2, static_cast<Index>(options.line_band * log.filter.torque_cutoff_hz * seconds));
    if (b.healthy || bins < neighbours) continue;
    const std::vector<double> x(e.data() + b.first, e.data() + b.first + b.count);
    std::vector<std::complex<double>> spectrum;
    fft.fwd(spectrum, x);
    VectorXd power(bins);
    for (Index k = 0; k < bins; ++k) power[k] = std::norm(spectrum[static_cast<std::size_t>(k + 1)]);
    whole += power.sum();
    add_lines(power, lines);
  }
  TimeStructure out;
  if (lines.empty()) return out;  // too short
  double beyond = 0;
  for (const Line& line : lines) {
    const double p = chance_of(line, static_cast<double>(lines.size()));
    out.p = std::min(out.p, p);
    if (p < options.line) beyond += line.power - line.level;
  }
  if (whole > 0) out.share = beyond / whole;
  return out;
}

TimeStructure slow_changes(const std::vector<SessionLog>& logs, const Blocks& blocks, const VectorXd& e,
                           const std::vector<std::size_t>& of, const LackOfFitOptions& options) {
  constexpr double fewest = 5;  // stretches: with fewer the F distribution's approximation is none
  double sum[2] = {0, 0}, count[2] = {0, 0}, rows = 0, whole = 0;
  const auto add = [&](const Block& b) {
    const ProcessedLog& log = logs[b.log].log;
    const auto length = fxdyn::whole(options.stretch_s / (log.step_s * static_cast<double>(log.decimation)));
    if (length < 2) return;
    for (Index k = 0; k + length <= b.count; k += length) {
      const double mean = e.segment(b.first + k, length).mean();
      sum[b.healthy] += mean * mean;
      count[b.healthy] += 1;
    }
    if (b.healthy) return;
    rows += static_cast<double>(b.count);
    whole += e.segment(b.first, b.count).squaredNorm();
  };
  for (const std::size_t i : of) {
    if (!blocks.all[i].healthy) add(blocks.all[i]);
  }
  for (const Block& b : blocks.all) {
    if (b.healthy) add(b);
  }
  TimeStructure out;
  if (count[0] < fewest || count[1] < fewest || !(sum[1] > 0)) return out;
  out.p = chance(sum[0] / count[0] / (sum[1] / count[1]), count[0], count[1]);
  if (out.p < options.slow_change) out.share = std::max(0.0, sum[0] / count[0] - sum[1] / count[1]) * rows / whole;
  return out;
}

}  // namespace fxdyn::diagnosis
