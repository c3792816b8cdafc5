#include "host_tools/diagnose/time_curve.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "host_tools/diagnose/curve_sentence.hpp"
#include "host_tools/diagnose/features.hpp"
#include "host_tools/diagnose/finding.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/regression/solver.hpp"
#include "model/effects/curve.hpp"
#include "model/numbers.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t turns = 5;
/// Numeric choices: knots at most, and points drawn between two of them.
constexpr Index most_pieces = 300, points_a_piece = 4;
/// Rows a coefficient at least.
constexpr double fewest_rows = 5;

/// Sums of products of some rows' columns by the stretch of time that they are in, every fifth together.
class FoldSums {
 public:
  FoldSums(const MatrixXd& x, const TimedRows& rows, double stretch_s) {
    for (Index i = 0; i < rows.t.size(); ++i)
      rows_[static_cast<std::size_t>(std::floor((rows.t[i] - rows.t[0]) / stretch_s)) % turns].push_back(i);
    whole_.gram.setZero(x.cols(), x.cols());
    whole_.projection.setZero(x.cols());
    for (std::size_t k = 0; k < turns; ++k) {
      const MatrixXd part = x(rows_[k], Eigen::all);
      const VectorXd e = rows.e(rows_[k]);
      fold_[k] = {part.transpose() * part, part.transpose() * e, e.squaredNorm()};
      whole_.gram += fold_[k].gram;
      whole_.projection += fold_[k].projection;
      whole_.square += fold_[k].square;
    }
  }
  /// Squares that fits leave on what they have not seen.
  /// @param prior the noise's variance over that of a coefficient
  double left(double prior) const {
    double out = 0;
    for (const Sums& judge : fold_) out += left(prior, judge);
    return out;
  }
  /// Deviation of the share that they take away.
  double deviation(double prior) const {
    double sum = 0, square = 0;
    for (const Sums& judge : fold_) {
      const double share = judge.square > 0 ? left(prior, judge) / judge.square : 1;
      sum += share;
      square += share * share;
    }
    return std::sqrt(std::max(0.0, square - sum * sum / turns) / (turns * (turns - 1)));
  }
  /// Errors of fits on what they have not seen.
  VectorXd errors(double prior, const MatrixXd& x, const VectorXd& e) const {
    VectorXd out = e;
    for (std::size_t k = 0; k < turns; ++k) out(rows_[k]) -= x(rows_[k], Eigen::all) * without(prior, fold_[k]);
    return out;
  }
  double square() const { return whole_.square; }
  VectorXd coefficients(double prior) const { return solve(prior, whole_.gram, whole_.projection); }
  /// @param variance of the noise, of a row that counts as one
  MatrixXd covariance(double prior, double variance) const {
    return variance * SymmetricSolver(with(prior, whole_.gram)).inverse();
  }

 private:
  struct Sums {
    MatrixXd gram;
    VectorXd projection;
    double square = 0;
  };
  VectorXd without(double prior, const Sums& judge) const {
    return solve(prior, whole_.gram - judge.gram, whole_.projection - judge.projection);
  }
  double left(double prior, const Sums& judge) const {
    const VectorXd c = without(prior, judge);
    return judge.square - 2 * c.dot(judge.projection) + c.dot(judge.gram * c);
  }
  static MatrixXd with(double prior, MatrixXd gram) {
    gram.diagonal().array() += prior;
    return gram;
  }
  static VectorXd solve(double prior, const MatrixXd& gram, const VectorXd& projection) {
    return with(prior, gram).ldlt().solve(projection);
  }

  std::array<std::vector<Index>, turns> rows_;
  std::array<Sums, turns> fold_;
  Sums whole_{{}, {}, 0};
};

/// How many rows' errors say what one says: Bartlett's window over two seconds, as in diluted_weights().
double dilution(const VectorXd& e, double row_s) {
  const auto span = std::min<Index>(e.size(), static_cast<Index>(std::lround(2 / row_s)));
  double sum = 0;
  for (Index lag = 1; lag < span; ++lag)
    sum += 2 * (1 - static_cast<double>(lag) / static_cast<double>(span)) *
           e.head(e.size() - lag).dot(e.tail(e.size() - lag));
  return std::max(1.0, 1 + sum / std::max(e.squaredNorm(), 1e-300));
}

double mean_square(const VectorXd& e) { return e.squaredNorm() / static_cast<double>(std::max<Index>(e.size(), 1)); }

MatrixXd columns_of(const TimeFit& fit, const TimedRows& rows) {
  MatrixXd out = bumps_over_time(fit, rows.t);
  if (fit.friction) out = rows.sign.asDiagonal() * out;
  return out;
}

/// Logs of one clock: all of today's session, or the longest recording of either session.
std::vector<std::size_t> logs_of_one_clock(const Linearised& problem, bool healthy) {
  std::vector<std::size_t> out;
  Index longest = 0;
  for (const std::vector<std::size_t>& windows : by_recording(problem.logs())) {
    if (problem.logs()[windows.front()].healthy != healthy) continue;
    Index rows = 0;
    for (const std::size_t l : windows) rows += problem.blocks().of_log[l].count;
    if (!healthy && problem.models().current->session) {
      out.insert(out.end(), windows.begin(), windows.end());
    } else if (rows > longest) {
      longest = rows;
      out = windows;
    }
  }
  std::sort(out.begin(), out.end(),
            [&](std::size_t a, std::size_t b) { return problem.motion(a).t[0] < problem.motion(b).t[0]; });
  return out;
}

/// Rows where the encoder shows which way the joint moves.
/// @param state rivals of all rows
TimedRows rows_of(const Linearised& problem, std::size_t joint, const std::vector<std::size_t>& logs,
                  const MatrixXd& state) {
  const LinearFit fit = problem.solver().solve(problem.columns_of(in_model(problem)));
  const VectorXd e = problem.solver().residual(joint, fit);
  const double width = joints_of(problem.models().current)[joint].sign_width;
  std::vector<double> t, sign;
  std::vector<Index> kept;
  for (const std::size_t l : logs) {
    const ProcessedLog& log = problem.logs()[l].log;
    const Block& block = problem.blocks().of_log[l];
    const VectorXd times = log.decimate(problem.motion(l).t);
    const VectorXd dq = log.decimate(problem.motion(l).dq.col(static_cast<Index>(joint)));
    for (Index i = 0; i < block.count; ++i) {
      if (problem.noise().is_doubtful(joint, block.first + i)) continue;
      kept.push_back(block.first + i);
      t.push_back(times[i]);
      sign.push_back(std::tanh(dq[i] / width));
    }
  }
  const auto vector = [](const std::vector<double>& of) {
    return VectorXd(Eigen::Map<const VectorXd>(of.data(), static_cast<Index>(of.size())));
  };
  return {vector(t), e(kept), vector(sign), state(kept, Eigen::all)};
}

}  // namespace

MatrixXd bumps_over_time(const TimeFit& fit, const VectorXd& t) {
  const Index pieces = fit.heights.size() - 3;
  MatrixXd out = MatrixXd::Zero(t.size(), fit.heights.size());
  for (Index i = 0; i < t.size(); ++i) {
    const double place = std::clamp((t[i] - fit.from) / fit.knot_s, 0.0, static_cast<double>(pieces));
    const auto piece = std::min(pieces - 1, static_cast<Index>(place));
    // The last knot belongs to the piece before it.
    const Curve<Real> four = Curve<Real>::at(std::min(place - static_cast<double>(piece), std::nextafter(1.0, 0.0)));
    for (std::size_t k = 0; k < four.weights.size(); ++k)
      out(i, piece + static_cast<Index>(four.first + k)) = four.weights[k];
  }
  return out;
}

std::optional<TimeFit> fit_over_time(const TimedRows& rows, double size, double row_s, const CurveOptions& options) {
  const Index count = rows.t.size();
  if (count == 0) return {};
  const double seconds = rows.t[count - 1] - rows.t[0];
  std::optional<TimeFit> best;
  double least = 1e300, tried = 0;
  // In units of a row's error: its variance over that of a height.
  const double prior = mean_square(rows.e) / (size * size);
  for (Index pieces = static_cast<Index>(curve_pieces); pieces <= most_pieces; pieces *= 2) {
    if (seconds / static_cast<double>(pieces) < options.finest_s) break;
    if (static_cast<double>(count) < fewest_rows * static_cast<double>(pieces + 3)) break;
    for (const bool friction : {false, true}) {
      TimeFit fit;
      fit.from = rows.t[0];
      fit.knot_s = seconds / static_cast<double>(pieces);
      fit.friction = friction;
      fit.heights.setZero(pieces + 3);
      const double left = FoldSums(columns_of(fit, rows), rows, options.left_out_s).left(prior);
      ++tried;
      if (left >= least) continue;
      least = left;
      best = fit;
    }
  }
  if (!best) return {};
  const MatrixXd x = columns_of(*best, rows);
  const FoldSums sums(x, rows, options.left_out_s);
  best->heights = sums.coefficients(prior);
  const double diluted = dilution(sums.errors(prior, x, rows.e), row_s);
  best->covariance = sums.covariance(prior, diluted * least / static_cast<double>(count));
  best->closes = 1 - least / sums.square();
  best->closes_std = sums.deviation(prior);
  best->odds_nothing =
      static_cast<double>(count) / diluted * std::log(sums.square() / least) / variances_per_decade - std::log10(tried);
  // Many functions on few rows want to be held tighter: the best of a few priors counts.
  best->square_of_rivals = 1;
  if (rows.rivals.cols() == 0) return best;
  const FoldSums rivals(rows.rivals, rows, options.left_out_s);
  for (double times = 1; times <= 1000; times *= 10)
    best->square_of_rivals = std::min(best->square_of_rivals, rivals.left(times * prior) / sums.square());
  return best;
}

std::optional<CurveResult> time_curve(const Linearised& problem, std::size_t joint) {
  const Options& options = problem.options();
  const std::vector<std::size_t> logs = logs_of_one_clock(problem, false);
  if (logs.empty()) return {};
  MatrixXd state = features(problem, joint);
  state.conservativeResize(Eigen::NoChange, state.cols() - time_features);
  const SessionLog& first = problem.logs()[logs.front()];
  const double row_s = first.log.step_s * static_cast<double>(first.log.decimation);
  const double size = options.curve.height / std::sqrt(problem.solver().weights()[static_cast<Index>(joint)]);
  const TimedRows rows = rows_of(problem, joint, logs, state);
  const std::optional<TimeFit> fit = fit_over_time(rows, size, row_s, options.curve);
  if (!fit || fit->odds_nothing < options.gate.established || fit->closes < options.curve.least_share_in_time ||
      fit->square_of_rivals < 1 - fit->closes)
    return {};
  if (problem.has_baseline()) {
    const MatrixXd no_rivals(problem.blocks().rows(), 0);
    const TimedRows before = rows_of(problem, joint, logs_of_one_clock(problem, true), no_rivals);
    const std::optional<TimeFit> healthy = fit_over_time(before, size, row_s, options.curve);
    const double also = healthy ? std::max(0.0, healthy->closes) * mean_square(before.e) / mean_square(rows.e) : 0;
    if (fit->closes - also < options.curve.least_share_in_time) return {};
  }
  CurveResult out;
  out.effect = "time_curve";
  out.signal = "t";
  out.unit = "s";
  out.friction = fit->friction;
  out.odds_nothing = fit->odds_nothing;
  out.closes = fit->closes;
  out.closes_std = fit->closes_std;
  if (!problem.models().current->session) out.log = first.log.name;
  const Index pieces = fit->heights.size() - 3, points = points_a_piece * pieces + 1;
  const VectorXd t = VectorXd::LinSpaced(points, fit->from, fit->from + fit->knot_s * static_cast<double>(pieces));
  MatrixXd x = bumps_over_time(*fit, t);
  x.rowwise() -= x.colwise().mean().eval();  // an offset, or dry friction, is nominal
  const VectorXd y = x * fit->heights;
  const VectorXd variance = (x * fit->covariance).cwiseProduct(x).rowwise().sum();
  for (Index i = 0; i < points; ++i) out.points.push_back({t[i], y[i], std::sqrt(std::max(variance[i], 0.0))});
  tell(out, robot_of(problem.models().current), joint, problem.logs());
  return out;
}

}  // namespace fxdyn::diagnosis
