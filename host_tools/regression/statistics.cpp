// Standard deviations, robust weights, recursive least squares: what Fitter does with rows rather than with moments.

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "host_tools/effects/effects.hpp"
#include "host_tools/regression/fitter.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/regression/tie.hpp"
#include "host_tools/regression/unknown_shapes.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

double median(VectorXd values) {
  const Index middle = values.size() / 2;
  std::nth_element(values.begin(), values.begin() + middle, values.end());
  return values[middle];
}

}  // namespace

std::vector<double> Fitter::weighted_squares(const Solution& solution) const {
  std::vector<double> out(joints());
  parallel_for(joints(), [&](std::size_t j) {
    const VectorXd e = residual(j, solution);
    for (const std::size_t b : train_blocks()) {
      const LogBlock& block = data_->blocks[b];
      const Index count = block.to - block.from;
      out[j] += weights_[static_cast<Index>(j)] *
                row_weights_[j].segment(block.from, count).dot(e.segment(block.from, count).cwiseAbs2());
    }
  });
  return out;
}

std::vector<double> Fitter::fitted_rmse(const Solution& solution) const {
  std::vector<double> out = weighted_squares(solution);
  for (std::size_t j = 0; j < joints(); ++j)
    out[j] = std::sqrt(out[j] / (weights_[static_cast<Index>(j)] * std::max(train_rows(j), 1.0)));
  return out;
}

double Fitter::weighted_square(const Solution& solution) const {
  const std::vector<double> squares = weighted_squares(solution);
  return std::accumulate(squares.begin(), squares.end(), prior_.empty() ? 0.0 : prior_.square(solution.beta));
}

namespace {

/// One joint's part of the sandwich: rows of one stretch of consecutive samples.
struct Stretch {
  RowMajor x;         ///< all unknowns that act on the joint; rows that are not used are zero
  VectorXd e;         ///< weighted residual
  RowMajor around{};  ///< R x
};

/// R X for consecutive rows: sum over lags of the autocorrelation times the rows that far before and after.
RowMajor correlated(const RowMajor& x, const VectorXd& autocorrelation) {
  RowMajor out = autocorrelation[0] * x;
  for (Index lag = 1; lag < std::min(autocorrelation.size(), x.rows()); ++lag) {
    const Index count = (x.rows() - lag) * x.cols();
    Eigen::Map<VectorXd>(out.data(), count) +=
        autocorrelation[lag] * Eigen::Map<const VectorXd>(x.row(lag).data(), count);
    Eigen::Map<VectorXd>(out.row(lag).data(), count) +=
        autocorrelation[lag] * Eigen::Map<const VectorXd>(x.data(), count);
  }
  return out;
}

/// Sum over k of a_k . b_(k + lag): of consecutive rows, so one dot product.
double lagged(const RowMajor& a, const RowMajor& b, Index lag) {
  const Index count = (a.rows() - lag) * a.cols();
  if (count <= 0) return 0;
  return Eigen::Map<const VectorXd>(a.data(), count).dot(Eigen::Map<const VectorXd>(b.row(lag).data(), count));
}

/// The number of lags after which an autocorrelation stays below what the estimate itself scatters: the first lag from
/// which on five in a row are below 2 sqrt(log10 N / N) (Politis, White 2004, Econometric Reviews 23(1), section 3.3).
/// More lags only add scatter: the sum over them, which is what counts, becomes too small where the fit has taken the
/// noise's low frequencies.
Index last_correlated(const VectorXd& autocorrelation, double rows) {
  constexpr Index quiet = 5;
  const double least = 2 * std::sqrt(std::log10(rows) / rows) * autocorrelation[0];
  Index last = 0;
  for (Index lag = 1; lag < autocorrelation.size() && lag <= last + quiet; ++lag) {
    if (std::fabs(autocorrelation[lag]) > least) last = lag;
  }
  return last;
}

/// Autocorrelation of one joint's noise, and the middle of the sandwich.
class NoiseOfJoint {
 public:
  NoiseOfJoint(std::vector<Stretch> stretches, double weight, double rows, Index lags)
      : stretches_(std::move(stretches)), weight_(weight), rows_(std::max(rows, 1.0)), residual_(VectorXd::Zero(lags)) {
    for (const Stretch& s : stretches_) {
      for (Index lag = 0; lag < std::min(lags, s.e.size()); ++lag)
        residual_[lag] += s.e.head(s.e.size() - lag).dot(s.e.tail(s.e.size() - lag)) / rows_;
    }
    noise_ = residual_;
    spread_out();
  }
  /// The fit has taken some of the noise, most at the low frequencies where its columns live:
  ///   E e e^T = (1 - H) R (1 - H)^T,  H = X A^-1 X^T W,
  /// so R = autocorrelation of e + H R + R H^T - X Cov X^T, solved by iteration.
  void correct(const MatrixXd& inverse, const MatrixXd& covariance) {
    VectorXd taken = VectorXd::Zero(noise_.size());
    for (const Stretch& s : stretches_) {
      const RowMajor fit = weight_ * (s.x * inverse), spread = s.x * covariance;
      for (Index lag = 0; lag < std::min(taken.size(), s.x.rows()); ++lag)
        taken[lag] += (lagged(fit, s.around, lag) + lagged(s.around, fit, lag) - lagged(spread, s.x, lag)) / rows_;
    }
    noise_ = residual_ + taken;
    spread_out();
  }
  /// Degrees of freedom of the estimated spectrum, N / (sum over all lags of the taper's square) (Blackman and Tukey
  /// 1958; Percival and Walden 1993, section 6.10): the middle scatters like chi squared with so many.
  double freedom() const { return freedom_; }
  MatrixXd middle() const {
    MatrixXd out = MatrixXd::Zero(stretches_[0].x.cols(), stretches_[0].x.cols());
    for (const Stretch& s : stretches_) out += s.x.transpose() * s.around;
    return weight_ * weight_ * out;
  }

 private:
  void spread_out() {
    // flat to where it has faded, then down to zero over as many lags
    const Index lags = std::min(noise_.size(), 2 * (last_correlated(noise_, rows_) + 1));
    VectorXd taper(lags);
    for (Index lag = 0; lag < lags; ++lag)
      taper[lag] = std::min(1.0, 2 * (1 - static_cast<double>(lag) / static_cast<double>(lags)));
    const VectorXd tapered = taper.cwiseProduct(noise_.head(lags));
    freedom_ = rows_ / (2 * taper.squaredNorm() - 1);
    for (Stretch& s : stretches_) s.around = correlated(s.x, tapered);
  }
  std::vector<Stretch> stretches_;
  double weight_, rows_, freedom_ = 0;
  VectorXd residual_, noise_;  ///< autocorrelation at lags 0, 1, ..
};

/// `std`: of all unknowns, where linear[j] is the first of joint j's coefficients and shapes[j] the first of its shapes
/// (logarithms; none with a BLS).
void set_standard_deviations(Solution& solution, const VectorXd& std, const std::vector<Index>& linear,
                             const std::vector<Index>& shapes, const std::vector<JointFit>& designs) {
  solution.beta_std = std.head(solution.beta.size());
  solution.theta_std.clear();
  solution.sign_width_std.assign(designs.size(), 0.0);
  solution.shape_std.assign(designs.size(), {});
  for (std::size_t j = 0; j < designs.size(); ++j) {
    solution.theta_std.emplace_back(std.segment(linear[j], linear[j + 1] - linear[j]));
    Index at = shapes[j];
    const bool has_shapes = shapes[j + 1] > at;
    if (has_shapes) solution.sign_width_std[j] = std[at++] * designs[j].sign_width;
    for (const EffectFit& fit : designs[j].effects) {
      const auto infos = find_effect(fit.effect)->shape;
      std::vector<double> stds(infos.size(), 0.0);
      for (std::size_t i = 0; i < infos.size(); ++i) {
        if (is_continuous(infos[i]) && has_shapes) stds[i] = std[at++] * fit.shape[i];
      }
      solution.shape_std[j].push_back(stds);
    }
  }
}

}  // namespace

void Fitter::add_standard_deviations(Solution& solution) const {
  std::vector<MatrixXd> shapes;
  const NormalEquations all = with_shapes(solution, shapes);
  const NormalEquations linear = normal_equations();
  const Index p = all.offset.back();
  // The filter correlates noise over a few periods of its cut-off at most.
  const ProcessedLog& log = logs().front();
  const double rate = 1 / (log.step_s * static_cast<double>(log.decimation));
  const auto lags = static_cast<Index>(std::ceil(4 * rate / log.filter.torque_cutoff_hz)) + 1;

  std::vector<std::optional<NoiseOfJoint>> noise(joints());
  std::vector<std::vector<Index>> columns(joints());  // of each joint, among all unknowns
  std::vector<MatrixXd> middles(joints());
  std::vector<double> bread(joints(), 1.0);
  solution.freedom.assign(joints(), 0.0);
  double train_rows = 0;
  for (std::size_t l = 0; l < logs().size(); ++l)
    train_rows += logs()[l].role == Role::train ? static_cast<double>(logs()[l].rows()) : 0;
  // What the fit takes does not show where there are a thousand rows a parameter.
  const bool correcting = train_rows < 1000 * static_cast<double>(p);
  parallel_for(joints(), [&](std::size_t j) {
    const Index first = data_->first_base[j], nb = solution.beta.size(), own = own_rows_[j].cols();
    for (Index c = first; c < nb; ++c) columns[j].push_back(c);
    for (Index c = 0; c < own; ++c) columns[j].push_back(linear.offset[j] + c);
    for (Index c = 0; c < shapes[j].cols(); ++c) columns[j].push_back(all.offset[j] + c);
    const VectorXd e = residual(j, solution);
    std::vector<Stretch> stretches;
    double rows = 0, weights = 0;
    Index untouched = 0;
    for (std::size_t l = 0; l < logs().size(); ++l) {
      if (logs()[l].role != Role::train) continue;
      const Index from = data_->first_row[l], count = logs()[l].rows();
      const auto usable = data_->usable[j].segment(from, count), weight = row_weights_[j].segment(from, count);
      // Huber's weights belong to the residual (psi = w e), those of age to the rows; rows that are not used have no
      // noise.
      Stretch s{RowMajor(count, static_cast<Index>(columns[j].size())),
                (robust_ ? weight : usable).cwiseProduct(e.segment(from, count))};
      s.x << data_->base_rows[j].middleRows(from, count), own_rows_[j].middleRows(from, count),
          shapes[j].middleRows(from, count);
      s.x = (robust_ ? usable : weight).asDiagonal() * s.x;
      rows += usable.sum();
      weights += weight.sum();
      untouched += (weight.array() >= 1).count();
      stretches.push_back(std::move(s));
    }
    // The bread of Huber's sandwich is psi' (1 for rows that are not cut, else 0) where the information has w.
    if (robust_ && untouched > 0) bread[j] = weights / static_cast<double>(untouched);
    noise[j].emplace(std::move(stretches), weights_[static_cast<Index>(j)], rows, lags);
    middles[j] = noise[j]->middle();
    solution.freedom[j] = noise[j]->freedom();
    if (!correcting) noise[j].reset();  // a long log's rows are not held for all joints
  });
  const MatrixXd inverse = SymmetricSolver(all.information).inverse();
  const auto sandwich = [&] {
    MatrixXd middle = MatrixXd::Zero(p, p);
    for (std::size_t j = 0; j < joints(); ++j) middle(columns[j], columns[j]) += bread[j] * bread[j] * middles[j];
    return MatrixXd(inverse * middle * inverse);
  };
  MatrixXd covariance = sandwich();
  for (int round = 0; round < 2 && correcting; ++round) {
    parallel_for(joints(), [&](std::size_t j) {
      noise[j]->correct(inverse(columns[j], columns[j]), covariance(columns[j], columns[j]));
      middles[j] = noise[j]->middle();
      solution.freedom[j] = noise[j]->freedom();
    });
    covariance = sandwich();
  }
  // The taper may leave a variance that is next to nothing below zero: then that of independent rows.
  VectorXd std = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  for (Index k = 0; k < p; ++k) {
    if (!(covariance(k, k) > 0)) std[k] = std::sqrt(std::max(0.0, inverse(k, k)));
  }
  solution.covariance = covariance.topLeftCorner(linear.offset.back(), linear.offset.back());
  set_standard_deviations(solution, std, linear.offset, all.offset, design_);
}

void Fitter::reweight_rows() {
  constexpr double efficient = 1.345;  // Huber 1964: 95 % efficiency
  robust_ = true;
  reweight();
  for (int round = 0; round < 8; ++round) {
    const Solution solution = solve(normal_equations());
    parallel_for(joints(), [&](std::size_t j) {
      const VectorXd magnitude = residual(j, solution).cwiseAbs();
      std::vector<double> judged;
      for (std::size_t l = 0; l < logs().size(); ++l) {
        for (Index k = data_->first_row[l]; k < data_->first_row[l] + logs()[l].rows(); ++k)
          if (logs()[l].role == Role::train && data_->usable[j][k] > 0) judged.push_back(magnitude[k]);
      }
      if (judged.empty()) return;
      const double scale =
          1.4826 * median(Eigen::Map<const VectorXd>(judged.data(), static_cast<Index>(judged.size())));
      if (!(scale > 0)) return;
      row_weights_[j] = data_->usable[j];
      for (std::size_t l = 0; l < logs().size(); ++l) {
        if (logs()[l].role != Role::train) continue;  // what judges is not touched
        for (Index k = data_->first_row[l]; k < data_->first_row[l] + logs()[l].rows(); ++k)
          row_weights_[j][k] *= std::min(1.0, efficient * scale / std::max(magnitude[k], 1e-300));
      }
      make_base_moments(j);
      own_moments_[j] = own_moments(j, own_rows_[j]);
      project_torque(j);
      weights_[static_cast<Index>(j)] = 1 / (scale * scale);
    });
  }
}

void Fitter::forget(double forgetting) {
  double age = 0;
  for (std::size_t l = logs().size(); l-- > 0;) {
    const ProcessedLog& log = logs()[l];
    if (log.role != Role::train) continue;
    const double interval = log.step_s * static_cast<double>(log.decimation);
    for (Index k = data_->first_row[l] + log.rows(); k-- > data_->first_row[l]; age += interval) {
      for (std::size_t j = 0; j < joints(); ++j) row_weights_[j][k] = data_->usable[j][k] * std::pow(forgetting, age);
    }
  }
  for (std::size_t j = 0; j < joints(); ++j) {
    make_base_moments(j);
    own_moments_[j] = own_moments(j, own_rows_[j]);
    project_torque(j);
  }
}

void Fitter::take_in(Index from, Index count, const std::vector<VectorXd>& row_weights,
                     SquareRootInformation& information) const {
  const std::vector<Index> offset = offsets();
  const Index nb = offset.front();
  for (std::size_t j = 0; j < joints(); ++j) {
    const Index first = data_->first_base[j], acting = nb - first, own = own_rows_[j].cols();
    const auto weight = row_weights[j].segment(from, count);
    const double rows = weight.sum();
    if (rows == 0) continue;
    std::vector<Index> columns;
    for (Index c = first; c < nb; ++c) columns.push_back(c);
    for (Index c = 0; c < own; ++c) columns.push_back(offset[j] + c);
    // Paper Eq. 30: mean square error + ridge |W|^2
    const VectorXd ridge = rows * ridge_of(design_[j], design_[j].bls ? design_[j].bls->ridge : 0, own);
    const Index penalties = (ridge.array() > 0).count();
    MatrixXd all = MatrixXd::Zero(count + penalties, acting + own + 1);
    all.topRows(count) << data_->base_rows[j].middleRows(from, count), own_rows_[j].middleRows(from, count),
        torque_rows_[j].segment(from, count);
    all.topRows(count) = weight.cwiseSqrt().asDiagonal() * all.topRows(count);
    for (Index c = 0, at = count; c < own; ++c) {
      if (ridge[c] > 0) all(at++, acting + c) = std::sqrt(ridge[c]);
    }
    information.take_in(std::sqrt(weights_[static_cast<Index>(j)]) * all, columns, rows);
  }
}

SquareRootInformation Fitter::prior_information() const {
  SquareRootInformation out(offsets().back());
  const std::vector<Index> offset = offsets();
  for (std::size_t j = 0; j < joints(); ++j) {
    const auto tie = tie_of(design_[j]);
    if (!tie) continue;
    const Index part = offset[j] + tie->part, whole = offset[j] + tie->whole;
    Eigen::RowVector3d row(1, -tie->share, 0);
    if (whole < part) std::swap(row[0], row[1]);
    out.take_in(std::sqrt(rows_of_tie * weights_[static_cast<Index>(j)] * train_rows(j)) * row,
                {std::min(part, whole), std::max(part, whole)}, 0);
  }
  if (prior_.empty()) return out;
  // information = root^T root; rows of unit weight
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(prior_.information);
  const Index nb = prior_.mean.size();
  MatrixXd rows(nb, nb + 1);
  rows.leftCols(nb) = solver.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() * solver.eigenvectors().transpose();
  rows.col(nb) = rows.leftCols(nb) * prior_.mean;
  std::vector<Index> columns(static_cast<std::size_t>(nb));
  std::iota(columns.begin(), columns.end(), 0);
  out.take_in(rows, columns, 0);
  return out;
}

SquareRootInformation Fitter::information() const {
  SquareRootInformation out = prior_information();
  for (const std::size_t b : train_blocks()) {
    const LogBlock& block = data_->blocks[b];
    take_in(block.from, block.to - block.from, row_weights_, out);
  }
  return out;
}

Fitter::Recursion Fitter::recursive(double forgetting, Index points, const SquareRootInformation& start) const {
  constexpr Index most_rows = 2048;  // at once
  const std::vector<Index> offset = offsets();
  Index total = 0;
  for (const ProcessedLog& log : logs()) total += log.role == Role::train ? log.rows() : 0;
  Recursion out;
  out.information = start.unknowns() > 0 ? start : prior_information();
  points = std::min(points, total);
  out.t.resize(points);
  out.trace.resize(points, offset.back());
  std::vector<VectorXd> row_weights = data_->usable;
  double seconds = 0;
  Index done = 0, point = 0;
  for (std::size_t l = 0; l < logs().size(); ++l) {
    const ProcessedLog& log = logs()[l];
    if (log.role != Role::train) continue;
    const double interval = log.step_s * static_cast<double>(log.decimation);
    const Index end = data_->first_row[l] + log.rows();
    for (Index from = data_->first_row[l], count = 0; from < end; from += count) {
      // Rows up to the next moment of the trace together: first all forgets, then each by its age.
      count = std::min(most_rows, end - from);
      if (point < points) count = std::min(count, ((point + 1) * total + points - 1) / points - done);
      out.information.forget(std::pow(forgetting, interval * static_cast<double>(count)));
      if (forgetting < 1) {
        for (VectorXd& weight : row_weights) {
          for (Index k = 0; k < count; ++k)
            weight[from + k] *= std::pow(forgetting, interval * static_cast<double>(count - 1 - k));
        }
      }
      take_in(from, count, row_weights, out.information);
      seconds += interval * static_cast<double>(count);
      done += count;
      if (point < points && done * points >= (point + 1) * total) {
        out.t[point] = seconds;
        out.trace.row(point++) = out.information.solve().transpose();
      }
    }
  }
  out.solution = split(offset, out.information.solve());
  return out;
}

}  // namespace fxdyn
