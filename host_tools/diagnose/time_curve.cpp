#include "host_tools/diagnose/time_curve.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "host_tools/diagnose/curve_sentence.hpp"
#include "host_tools/diagnose/deviations.hpp"
#include "host_tools/diagnose/finding.hpp"
#include "host_tools/diagnose/models.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/logs/log.hpp"
#include "host_tools/regression/solver.hpp"
#include "model/effects/curve.hpp"
#include "model/numbers.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t turns = 5;
/// Numeric choices: knots at most, and points drawn a piece.
constexpr Index most_pieces = 300, points_a_piece = 2;
/// What is left of data without noise is rounding: this share of their power.
constexpr double rounding = 1e-14;
/// Rows a coefficient at least.
constexpr double fewest_rows = 5;

/// Heights' factors at a time: of the first of four, and theirs. The others are nothing.
std::pair<Index, Eigen::Matrix<double, 4, 1>> bumps_at(const TimeFit& fit, double t) {
  const Index pieces = fit.heights.size() - 3;
  const double place = std::clamp((t - fit.from) / fit.knot_s, 0.0, static_cast<double>(pieces));
  const auto piece = std::min(pieces - 1, static_cast<Index>(place));
  // The last knot belongs to the piece before it.
  const Curve<Real> four = Curve<Real>::at(std::min(place - static_cast<double>(piece), std::nextafter(1.0, 0.0)));
  return {piece + static_cast<Index>(four.first), Eigen::Map<const Eigen::Matrix<double, 4, 1>>(four.weights.data())};
}

struct FoldSum {
  MatrixXd gram;
  VectorXd projection;
  double square = 0;
};

/// Columns of rows that each function has a value in.
struct DenseColumns {
  const MatrixXd& x;
  Index count() const { return x.cols(); }
  void add(Index first, Index rows, const VectorXd& e, FoldSum& to) const {
    const auto part = x.middleRows(first, rows);
    to.gram.noalias() += part.transpose() * part;
    to.projection.noalias() += part.transpose() * e.segment(first, rows);
  }
};

/// Columns of a curve over time: a row has a value in four of them, so they are made as they are needed. A long log
/// has tens of thousands of rows times hundreds of columns.
class TimeColumns {
 public:
  using Weights = Eigen::Matrix<double, 4, 1>;
  TimeColumns(const TimeFit& fit, const TimedRows& rows) : fit_(fit), rows_(rows) {}
  Index count() const { return fit_.heights.size(); }
  /// The first of the four, and their values.
  std::pair<Index, Weights> of_row(Index i) const {
    const auto [first, weights] = bumps_at(fit_, rows_.t[i]);
    return {first, (fit_.friction ? rows_.sign[i] : 1) * weights};
  }
  void add(Index first, Index rows, const VectorXd& e, FoldSum& to) const {
    for (Index i = first; i < first + rows; ++i) {
      const auto [k, weights] = of_row(i);
      to.gram.block<4, 4>(k, k).noalias() += weights * weights.transpose();
      to.projection.segment<4>(k) += weights * e[i];
    }
  }
  double times(const VectorXd& heights, Index row) const {
    const auto [k, weights] = of_row(row);
    return weights.dot(heights.segment<4>(k));
  }
  /// (other columns)^T of rows, times these.
  MatrixXd products(const MatrixXd& others) const {
    MatrixXd out = MatrixXd::Zero(others.cols(), count());
    for (Index i = 0; i < others.rows(); ++i) {
      const auto [k, weights] = of_row(i);
      out.middleCols<4>(k).noalias() += others.row(i).transpose() * weights.transpose();
    }
    return out;
  }

 private:
  const TimeFit& fit_;
  const TimedRows& rows_;
};

/// FoldSum of products of some rows' columns by the stretch of time that they are in, every fifth or so together.
class FoldSums {
 public:
  template <class Columns>
  FoldSums(const Columns& x, const TimedRows& rows, double stretch_s) {
    const FoldSum none{MatrixXd::Zero(x.count(), x.count()), VectorXd::Zero(x.count()), 0};
    whole_ = none;
    fold_.fill(none);
    const auto fold_of = [&](Index i) {
      // One more each time: a motion that repeats itself would be left out at one phase.
      const auto stretch = static_cast<std::size_t>(std::floor((rows.t[i] - rows.t[0]) / stretch_s));
      return (stretch + stretch / turns) % turns;
    };
    for (Index first = 0, end = 0; first < rows.t.size(); first = end) {
      const std::size_t k = fold_of(first);
      while (end < rows.t.size() && fold_of(end) == k) ++end;
      x.add(first, end - first, rows.e, fold_[k]);
      fold_[k].square += rows.e.segment(first, end - first).squaredNorm();
      runs_.push_back({k, first, end});
    }
    for (const FoldSum& fold : fold_) {
      whole_.gram += fold.gram;
      whole_.projection += fold.projection;
      whole_.square += fold.square;
    }
  }
  /// Squares that fits leave on what they have not seen.
  /// @param prior the noise's variance over that of a coefficient
  double left(double prior) const {
    double out = 0;
    for (const FoldSum& judge : fold_) out += left(prior, whole_, judge);
    return out;
  }
  /// .. of some columns alone.
  double left(double prior, const Family& of) const {
    const auto some = [&](const FoldSum& sums) {
      return FoldSum{sums.gram.block(of.first, of.first, of.count, of.count),
                     sums.projection.segment(of.first, of.count), sums.square};
    };
    const FoldSum whole = some(whole_);
    double out = 0;
    for (const FoldSum& fold : fold_) out += left(prior, whole, some(fold));
    return out;
  }
  /// Deviation of the share that they take away.
  double deviation(double prior) const {
    double sum = 0, square = 0;
    for (const FoldSum& judge : fold_) {
      const double share = judge.square > 0 ? left(prior, whole_, judge) / judge.square : 1;
      sum += share;
      square += share * share;
    }
    return std::sqrt(std::max(0.0, square - sum * sum / turns) / (turns * (turns - 1)));
  }
  /// Errors of fits on what they have not seen.
  VectorXd errors(double prior, const TimeColumns& x, const VectorXd& e) const {
    std::array<VectorXd, turns> heights;
    for (std::size_t k = 0; k < turns; ++k) heights[k] = without(prior, whole_, fold_[k]);
    VectorXd out = e;
    for (const Run& run : runs_) {
      for (Index i = run.first; i < run.end; ++i) out[i] -= x.times(heights[run.fold], i);
    }
    return out;
  }
  const FoldSum& whole() const { return whole_; }

 private:
  struct Run {
    std::size_t fold;
    Index first, end;
  };
  static VectorXd without(double prior, const FoldSum& whole, const FoldSum& judge) {
    return solve(prior, whole.gram - judge.gram, whole.projection - judge.projection);
  }
  static double left(double prior, const FoldSum& whole, const FoldSum& judge) {
    const VectorXd c = without(prior, whole, judge);
    return judge.square - 2 * c.dot(judge.projection) + c.dot(judge.gram * c);
  }
  static MatrixXd with(double prior, MatrixXd gram) {
    gram.diagonal().array() += prior;
    return gram;
  }
  static VectorXd solve(double prior, const MatrixXd& gram, const VectorXd& projection) {
    return with(prior, gram).ldlt().solve(projection);
  }

  std::vector<Run> runs_;
  std::array<FoldSum, turns> fold_;
  FoldSum whole_;
};

double mean_square(const VectorXd& e) { return e.squaredNorm() / static_cast<double>(std::max<Index>(e.size(), 1)); }

/// Where the curve is drawn: both ends of every piece, and between them.
Index points_of(const TimeFit& fit) { return points_a_piece * (fit.heights.size() - 3) + 1; }

/// Those that judge are fitted too: their errors would be of another kind.
std::vector<std::size_t> all_blocks(const Linearised& problem) {
  std::vector<std::size_t> out(problem.blocks().all.size());
  std::iota(out.begin(), out.end(), std::size_t{0});
  return out;
}

/// Windows of each recording of a session that share a clock, in the order of their times.
std::vector<std::vector<std::size_t>> clocks_of(const Linearised& problem, bool healthy) {
  std::vector<std::vector<std::size_t>> out;
  const bool one = !healthy && problem.models().current->session;
  for (const std::vector<std::size_t>& windows : by_recording(problem.logs())) {
    if (problem.logs()[windows.front()].healthy != healthy) continue;
    if (!one || out.empty()) out.emplace_back();
    out.back().insert(out.back().end(), windows.begin(), windows.end());
  }
  for (std::vector<std::size_t>& logs : out) {
    std::sort(logs.begin(), logs.end(),
              [&](std::size_t a, std::size_t b) { return problem.motion(a).t[0] < problem.motion(b).t[0]; });
  }
  return out;
}

/// Drawn where there are rows, without what an offset, or dry friction, is of it: that is nominal.
void draw(const TimeFit& fit, const TimedRows& rows, CurveResult& to) {
  const Index points = points_of(fit);
  const VectorXd t =
      VectorXd::LinSpaced(points, fit.from, fit.from + fit.knot_s * static_cast<double>(fit.heights.size() - 3));
  MatrixXd x = bumps_over_time(fit, t);
  Eigen::RowVectorXd mean = Eigen::RowVectorXd::Zero(fit.heights.size());
  for (const double at : rows.t) {
    const auto [first, weights] = bumps_at(fit, at);
    mean.segment<4>(first) += weights.transpose() / static_cast<double>(rows.t.size());
  }
  x.rowwise() -= mean;
  const VectorXd y = x * fit.heights;
  const VectorXd variance = (x * fit.covariance).cwiseProduct(x).rowwise().sum();
  const double *begin = rows.t.data(), *end = begin + rows.t.size(), *next = begin;
  for (Index i = 0; i < points; ++i) {
    next = std::lower_bound(next, end, t[i]);
    const bool near = (next != end && *next - t[i] < fit.knot_s) || (next != begin && t[i] - *(next - 1) < fit.knot_s);
    if (near) to.points.push_back({t[i], y[i], std::sqrt(std::max(variance[i], 0.0) + fit.misfit)});
  }
}

}  // namespace

MatrixXd bumps_over_time(const TimeFit& fit, const VectorXd& t) {
  MatrixXd out = MatrixXd::Zero(t.size(), fit.heights.size());
  for (Index i = 0; i < t.size(); ++i) {
    const auto [first, weights] = bumps_at(fit, t[i]);
    out.row(i).segment<4>(first) = weights.transpose();
  }
  return out;
}

namespace {

/// Variance of what the curve can't follow: that of the residual's means between two drawn points, less what noise
/// makes of them.
double misfit(const TimeFit& fit, const TimedRows& rows, const VectorXd& residual, double diluted) {
  const auto bins = points_of(fit);
  VectorXd sum = VectorXd::Zero(bins), count = VectorXd::Zero(bins);
  for (Index i = 0; i < residual.size(); ++i) {
    const auto bin = std::clamp<Index>(
        static_cast<Index>((rows.t[i] - fit.from) / fit.knot_s * static_cast<double>(points_a_piece)), 0, bins - 1);
    sum[bin] += residual[i] * (fit.friction ? rows.sign[i] : 1);
    count[bin] += fit.friction ? rows.sign[i] * rows.sign[i] : 1;
  }
  double of_means = 0, used = 0;
  for (Index bin = 0; bin < bins; ++bin) {
    if (!(count[bin] > 0)) continue;
    of_means += sum[bin] * sum[bin] / count[bin];
    used += 1;
  }
  const double noise = std::max(0.0, residual.squaredNorm() - of_means) / std::max(count.sum() - used, 1.0);
  return std::max(0.0, of_means - used * noise * diluted) / std::max(count.sum(), 1.0);
}

/// What the best of the rivals leave: all of them, or a family. Many functions on few rows want to be held tighter: the
/// best of a few priors counts.
double square_of_rivals(const TimedRows& rows, double prior, double square, const CurveOptions& options) {
  double out = 1;
  if (rows.rivals.cols() == 0) return out;
  const FoldSums rivals(DenseColumns{rows.rivals}, rows, options.left_out_s);
  std::vector<Family> all = rows.families;
  all.push_back({0, rows.rivals.cols()});
  for (const Family& family : all) {
    for (const double times : {1.0, 10.0, 100.0, 1000.0})
      out = std::min(out, rivals.left(times * prior, family) / square);
  }
  return out;
}

}  // namespace

std::optional<TimeFit> fit_over_time(const TimedRows& rows, double size, double row_s, const CurveOptions& options) {
  const Index count = rows.t.size();
  if (count == 0 || !(rows.e.squaredNorm() > 0) || !(size > 0)) return {};
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
      const double left = FoldSums(TimeColumns(fit, rows), rows, options.left_out_s).left(prior);
      ++tried;
      if (left >= least) continue;
      least = left;
      best = fit;
    }
  }
  if (!best) return {};
  const TimeColumns x(*best, rows);
  const FoldSums sums(x, rows, options.left_out_s);
  Dilution dilution;
  dilution.add(sums.errors(prior, x, rows.e), row_s);
  const double diluted = dilution.value();
  // What was fitted before has some of the curve, which the residual lacks: with X its columns and C their covariance,
  // x is (1 - X C X^T) x to it.
  MatrixXd gram = sums.whole().gram, owned;
  if (rows.nominal.cols() > 0) {
    const MatrixXd products = x.products(rows.nominal);
    owned = rows.covariance * products;
    gram -= products.transpose() * owned;
  }
  gram.diagonal().array() += prior;
  const MatrixXd inverse = SymmetricSolver(gram).inverse();
  best->heights = inverse * sums.whole().projection;
  VectorXd rest = rows.e;
  for (Index i = 0; i < count; ++i) rest[i] -= x.times(best->heights, i);
  if (owned.size() > 0) rest += rows.nominal * (owned * best->heights);
  best->covariance = diluted * least / static_cast<double>(count) * inverse;
  best->closes = std::min(1.0, 1 - least / sums.whole().square);
  best->misfit = misfit(*best, rows, rest, diluted);
  best->closes_std = sums.deviation(prior);
  best->odds_nothing =
      static_cast<double>(count) / diluted * std::log(sums.whole().square / least) / variances_per_decade -
      std::log10(tried);
  best->square_of_rivals = square_of_rivals(rows, prior, sums.whole().square, options);
  return best;
}

TimeCurves::TimeCurves(const Linearised& problem)
    : problem_(problem),
      fit_(problem.solver().solve(problem.columns_of(in_model(problem)), all_blocks(problem))),
      covariance_(SymmetricSolver(fit_.information).inverse()),
      clocks_(clocks_of(problem, false)) {
  const auto rows = [&](const std::vector<std::size_t>& logs) {
    Index sum = 0;
    for (const std::size_t l : logs) sum += problem.blocks().of_log[l].count;
    return sum;
  };
  for (const std::vector<std::size_t>& recording : clocks_of(problem, true)) {
    if (rows(recording) > rows(healthy_)) healthy_ = recording;
  }
}

/// Rows where the encoder shows which way the joint moves. @param state rivals of all rows
TimedRows TimeCurves::rows_of(const std::vector<std::size_t>& logs, std::size_t joint, const MatrixXd& state) const {
  const VectorXd e = problem_.solver().residual(joint, fit_);
  const double width = joints_of(problem_.models().current)[joint].sign_width;
  std::vector<double> t, sign;
  std::vector<Index> kept;
  for (const std::size_t l : logs) {
    const ProcessedLog& log = problem_.logs()[l].log;
    const Block& block = problem_.blocks().of_log[l];
    const VectorXd times = log.decimate(problem_.motion(l).t);
    const VectorXd dq = log.decimate(problem_.motion(l).dq.col(static_cast<Index>(joint)));
    for (Index i = 0; i < block.count; ++i) {
      if (problem_.noise().is_doubtful(joint, block.first + i)) continue;
      kept.push_back(block.first + i);
      t.push_back(times[i]);
      sign.push_back(std::tanh(dq[i] / width));
    }
  }
  const auto vector = [](const std::vector<double>& of) {
    return VectorXd(Eigen::Map<const VectorXd>(of.data(), static_cast<Index>(of.size())));
  };
  return {vector(t), e(kept), vector(sign), state(kept, Eigen::all), {}, {}, {}, kept};
}

std::pair<MatrixXd, MatrixXd> TimeCurves::nominal_of(std::size_t joint) const {
  const JointRows& rows = problem_.solver().rows(joint);
  std::vector<Index> local, whole;
  for (std::size_t i = 0; i < fit_.columns.size(); ++i) {
    const Index place = rows.place(fit_.columns[i]);
    if (place < 0) continue;
    local.push_back(place);
    whole.push_back(static_cast<Index>(i));
  }
  const double weight = problem_.solver().weights()[static_cast<Index>(joint)];
  return {rows.x(Eigen::all, local), weight * covariance_(whole, whole)};
}

std::vector<CurveResult> TimeCurves::at(std::size_t joint) const {
  const auto j = static_cast<Index>(joint);
  if (!(fit_.square[j] > rounding * problem_.solver().rows(joint).y.squaredNorm())) return {};
  MatrixXd state = features(problem_, joint);
  state.conservativeResize(Eigen::NoChange, state.cols() - time_features);
  std::vector<Family> of_state = families(problem_.joints());
  of_state.pop_back();  // of time
  const auto [columns, covariance] = nominal_of(joint);
  // As the fit leaves them, over all of its rows: so the residual has them.
  if (const Background* background = problem_.background(joint))
    state = background->eliminate(state).topRows(state.rows());
  const auto nominal = columns.topRows(state.rows());
  state.noalias() -= nominal * (covariance * (nominal.transpose() * state));
  std::vector<CurveResult> out;
  for (const std::vector<std::size_t>& clock : clocks_) {
    TimedRows rows = rows_of(clock, joint, state);
    rows.nominal = columns(rows.place, Eigen::all);
    rows.covariance = covariance;
    rows.families = of_state;
    if (std::optional<CurveResult> curve = over(clock, joint, rows)) out.push_back(std::move(*curve));
  }
  std::sort(out.begin(), out.end(),
            [](const CurveResult& a, const CurveResult& b) { return a.odds_nothing > b.odds_nothing; });
  return out;
}

std::optional<CurveResult> TimeCurves::over(const std::vector<std::size_t>& clock, std::size_t joint,
                                            const TimedRows& rows) const {
  const Options& options = problem_.options();
  const SessionLog& first = problem_.logs()[clock.front()];
  const double row_s = first.log.step_s * static_cast<double>(first.log.decimation);
  const double size = options.curve.height / std::sqrt(problem_.solver().weights()[static_cast<Index>(joint)]);
  const std::optional<TimeFit> fit = fit_over_time(rows, size, row_s, options.curve);
  const auto counts = [&](double share) { return share >= options.gate.beyond_noise * (1 - share); };
  const bool is_sure = fit && fit->odds_nothing >= options.gate.established && counts(fit->closes) &&
                       fit->square_of_rivals >= 1 - fit->closes;
  if (!is_sure) return {};
  if (!healthy_.empty()) {
    const TimedRows before = rows_of(healthy_, joint, MatrixXd(problem_.blocks().rows(), 0));
    const std::optional<TimeFit> healthy = fit_over_time(before, size, row_s, options.curve);
    const double also = healthy ? std::max(0.0, healthy->closes) * mean_square(before.e) / mean_square(rows.e) : 0;
    if (!counts(fit->closes - also)) return {};
  }
  CurveResult out;
  out.effect = "time_curve";
  out.signal = "t";
  out.unit = "s";
  out.friction = fit->friction;
  out.odds_nothing = fit->odds_nothing;
  out.closes = fit->closes;
  out.closes_std = fit->closes_std;
  if (clocks_.size() > 1) out.log = first.log.name;
  draw(*fit, rows, out);
  tell(out, robot_of(problem_.models().current), joint, problem_.logs());
  return out;
}

void take_off(const CurveResult& curve, std::size_t joint, double sign_width, std::vector<SessionLog>& logs) {
  const auto n = static_cast<Index>(curve.points.size()), j = static_cast<Index>(joint);
  VectorXd x(n), y(n);
  for (Index i = 0; i < n; ++i) {
    x[i] = curve.points[static_cast<std::size_t>(i)].x;
    y[i] = curve.points[static_cast<std::size_t>(i)].y;
  }
  for (SessionLog& entry : logs) {
    ProcessedLog& log = entry.log;
    const bool is_of = curve.log.empty() || curve.log == log.name;
    if (entry.healthy || !is_of || log.t[log.last - 1] < x[0] || log.t[log.first] > x[n - 1]) continue;
    VectorXd torque = interpolate(y, x, log.t.cwiseMax(x[0]).cwiseMin(x[n - 1])).col(0);
    if (curve.friction) torque.array() *= (log.joint_velocity(j) / sign_width).array().tanh();
    log.tau.col(j) -= torque;
  }
}

}  // namespace fxdyn::diagnosis
