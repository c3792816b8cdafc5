#include "host_tools/diagnose/lack_of_fit.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <unsupported/Eigen/FFT>

#include "host_tools/identify/solver.hpp"
#include "host_tools/model/effects.hpp"
#include "host_tools/random.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int random_features = 24;
constexpr int shifts = 32;

/// The residual of the rows in `blocks` at other times of the same log: one column a shift.
MatrixXd shifted(const Linearised& at, std::size_t joint, const VectorXd& e, const std::vector<std::size_t>& blocks) {
  Random random(4177 + joint);
  MatrixXd out = MatrixXd::Zero(e.size(), shifts);
  for (const std::size_t i : blocks) {
    const Block& b = at.blocks()[i];
    if (b.healthy) continue;
    for (int k = 0; k < shifts; ++k) {
      const auto by = static_cast<Index>(random.uniform(0.08, 0.92) * static_cast<double>(b.count));
      out.block(b.first, k, b.count - by, 1) = e.segment(b.first + by, b.count - by);
      out.block(b.first + b.count - by, k, by, 1) = e.segment(b.first, by);
    }
  }
  return out;
}

VectorXd only(const Linearised& at, const VectorXd& e, const std::vector<std::size_t>& blocks) {
  VectorXd out = VectorXd::Zero(e.size());
  for (const std::size_t i : blocks) {
    const Block& b = at.blocks()[i];
    if (!b.healthy) out.segment(b.first, b.count) = e.segment(b.first, b.count);
  }
  return out;
}

/// Features on today's rows. Where the encoder does not tell which way the joint moves they are zero: friction's mean
/// over what the velocity may be is a smoother function of it than friction is, and that is no structure of the robot.
MatrixXd only(const Linearised& at, std::size_t joint, const MatrixXd& x, const std::vector<std::size_t>& blocks) {
  MatrixXd out = MatrixXd::Zero(x.rows(), x.cols());
  for (const std::size_t i : blocks) {
    const Block& b = at.blocks()[i];
    if (b.healthy) continue;
    for (Index row = b.first; row < b.first + b.count; ++row) {
      if (!at.is_doubtful(joint, row)) out.row(row) = x.row(row);
    }
  }
  return out;
}

/// Chance of F(freedom, other) beyond `ratio` (Paulson's normal approximation).
double chance(double ratio, double freedom, double other) {
  const double a = 2 / (9 * freedom), b = 2 / (9 * other), root = std::cbrt(ratio);
  const double z = ((1 - b) * root - (1 - a)) / std::sqrt(b * root * root + a);
  return 0.5 * std::erfc(z / std::numbers::sqrt2);
}

/// Something in the residual that is a matter of time.
struct InTime {
  double p = 1;      ///< chance that noise looks as much like it
  double share = 0;  ///< of the squared residual
};

/// Lines in the periodograms of the blocks against their neighbourhood.
InTime lines(const Linearised& at, const VectorXd& e, const std::vector<std::size_t>& blocks) {
  constexpr Index neighbours = 31;
  constexpr double inside = 0.8;
  constexpr double sure = 0.01;  // what noise has as seldom counts
  struct Line {
    double power, level;
  };
  std::vector<Line> all;
  double whole = 0;
  Eigen::FFT<double> fft;
  for (const std::size_t i : blocks) {
    const Block& b = at.blocks()[i];
    const ProcessedLog& log = at.logs()[b.log].log;
    const double seconds = static_cast<double>(b.count * log.decimation) * log.step_s;
    // Towards the cut-off the filter's slope is no line.
    const auto bins = std::min(b.count / 2, static_cast<Index>(inside * log.filter.torque_cutoff_hz * seconds));
    if (b.healthy || bins < neighbours) continue;
    const std::vector<double> x(e.data() + b.first, e.data() + b.first + b.count);
    std::vector<std::complex<double>> spectrum;
    fft.fwd(spectrum, x);
    VectorXd power(bins);
    for (Index k = 0; k < bins; ++k) power[k] = std::norm(spectrum[static_cast<std::size_t>(k + 1)]);
    whole += power.sum();
    for (Index k = 0; k < bins; ++k) {
      const Index n = std::min(neighbours, bins), from = std::clamp<Index>(k - n / 2, 0, bins - n);
      VectorXd near = power.segment(from, n);
      std::nth_element(near.begin(), near.begin() + n / 2, near.end());
      const double level = near[n / 2] / std::numbers::ln2;
      if (level > 0) all.push_back({power[k], level});
    }
  }
  InTime out;
  if (all.empty()) return out;  // too short to tell
  const auto count = static_cast<double>(all.size());
  // The level is itself a median of so many: of n exponential variables the chance of c times the median is
  // prod k / (k + c), k from the middle to n.
  const auto seldom = [&](const Line& line) {
    double p = count;
    for (Index k = (neighbours + 1) / 2; k <= neighbours; ++k) {
      const auto n = static_cast<double>(k);
      p *= n / (n + line.power / (line.level * std::numbers::ln2));
    }
    return p;
  };
  double beyond = 0;
  for (const Line& line : all) {
    const double p = seldom(line);
    out.p = std::min(out.p, p);
    if (p < sure) beyond += line.power - line.level;
  }
  if (whole > 0) out.share = beyond / whole;
  return out;
}

/// Means over stretches of two seconds against those of the healthy session.
InTime slow(const Linearised& at, const VectorXd& e, const std::vector<std::size_t>& blocks) {
  double sum[2] = {0, 0}, count[2] = {0, 0}, rows = 0, whole = 0;
  const auto add = [&](const Block& b) {
    const ProcessedLog& log = at.logs()[b.log].log;
    const auto length = static_cast<Index>(2 / (log.step_s * static_cast<double>(log.decimation)));
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
  for (const std::size_t b : blocks) {
    if (!at.blocks()[b].healthy) add(at.blocks()[b]);
  }
  for (const Block& b : at.blocks()) {
    if (b.healthy) add(b);
  }
  InTime out;
  if (count[0] < 5 || count[1] < 5 || !(sum[1] > 0)) return out;
  out.p = chance(sum[0] / count[0] / (sum[1] / count[1]), count[0], count[1]);
  if (out.p < 1e-3) out.share = std::max(0.0, sum[0] / count[0] - sum[1] / count[1]) * rows / whole;
  return out;
}

}  // namespace

MatrixXd features(const Linearised& at, std::size_t joint, bool healthy) {
  const std::size_t n = at.joints();
  const auto j = static_cast<Index>(joint);
  MatrixXd out;
  const Index total = at.log_rows(at.logs().size() - 1).first + at.log_rows(at.logs().size() - 1).count;
  Eigen::ArrayXd speed = Eigen::ArrayXd::Zero(static_cast<Index>(n)), acceleration = speed, load = speed;
  for (std::size_t l = 0; l < at.logs().size(); ++l) {
    const ProcessedLog& log = at.logs()[l].log;
    const auto inside = [&](const MatrixXd& m) {
      return m.middleRows(log.first, log.last - log.first).array().abs().colwise().maxCoeff().transpose();
    };
    speed = speed.max(inside(at.motion(l).dq).eval());
    acceleration = acceleration.max(inside(at.motion(l).ddq).eval());
    load = load.max(inside(at.robot_columns(l).structural()).eval());
  }
  speed = speed.max(1e-9);
  acceleration = acceleration.max(1e-9);
  load = load.max(1e-9);
  const bool turns = at.models().current.robot.joints[joint].type == JointType::revolute;
  VectorXd scales_of(3 * static_cast<Index>(n));
  scales_of << speed, acceleration, load;
  for (std::size_t l = 0; l < at.logs().size(); ++l) {
    if (at.logs()[l].healthy && !healthy) continue;
    const auto put = [&](const MatrixXd& rows) {
      if (out.size() == 0) out.setZero(total, rows.cols());
      out.middleRows(at.log_rows(l).first, at.log_rows(l).count) = at.finish(l, joint, rows);
    };
    RowCache::Features& kept = at.logs()[l].cache->features[joint];
    // The load moves a little with each fit; these functions need not.
    const auto motion = 2 * static_cast<Index>(n);
    if (kept.rows.size() > 0 && kept.scales.head(motion) == scales_of.head(motion) &&
        ((kept.scales - scales_of).array().abs() <= 0.05 * scales_of.array()).all()) {
      put(kept.rows);
      continue;
    }
    const Motion& m = at.motion(l);
    const Index samples = m.q.rows();
    std::vector<Eigen::ArrayXd> columns;
    const Eigen::ArrayXd q = m.q.col(j), dq = m.dq.col(j) / speed[j], ddq = m.ddq.col(j) / acceleration[j],
                         tau = at.robot_columns(l).structural().col(j).array() / load[j];
    const double scale = turns ? 1.0 : 10.0;
    for (std::size_t k = 0; k < n; ++k) {
      const auto i = static_cast<Index>(k);
      const bool peer_turns = at.models().current.robot.joints[k].type == JointType::revolute;
      const Eigen::ArrayXd qk = m.q.col(i) * (peer_turns ? 1.0 : 10.0), dqk = m.dq.col(i).array() / speed[i];
      columns.push_back(qk.sin());
      columns.push_back(qk.cos());
      columns.push_back((2 * qk).sin());
      columns.push_back((2 * qk).cos());
      if (k == joint) continue;
      columns.push_back((dqk * 40).tanh());
      columns.push_back(dqk);
      columns.push_back(dq * dqk);
    }
    for (const double width : {0.01, 0.03, 0.1, 0.3}) {
      columns.push_back((dq / width).tanh());
      columns.push_back((dq / width).tanh().abs());
    }
    columns.push_back(ddq);
    columns.push_back(ddq * ddq.abs());
    columns.push_back(tau);
    columns.push_back(tau * (dq * 40).tanh());
    for (const double distance : {1e-3, 5e-3}) {
      const JointSeries series{m.q.col(j), m.dq.col(j), m.ddq.col(j), {}, m.step_s};
      columns.push_back(effect_columns(Presliding::name, std::array{turns ? distance : 0.1 * distance},
                                       at.models().current.joints[joint].sign_width, series)
                            .col(0)
                            .array());
    }
    Random random(91 + joint);
    for (int r = 0; r < random_features; ++r) {
      const double a = 3 * random.normal(), b = 3 * random.normal(), c = 1.5 * random.normal(), d = random.normal(),
                   e = 2 * std::numbers::pi * random.uniform(), f = 2 * random.normal();
      columns.push_back((a * scale * q * 0.5 + b * dq + c * (dq / 0.02).asinh() + d * ddq + f * tau + e).cos());
    }
    MatrixXd full(samples, static_cast<Index>(columns.size()));
    for (std::size_t c = 0; c < columns.size(); ++c) full.col(static_cast<Index>(c)) = columns[c];
    const ProcessedLog& log = at.logs()[l].log;
    kept = {scales_of, log.decimate(log.filter_columns(full))};
    put(kept.rows);
  }
  return out;
}

LackOfFit lack_of_fit(const Linearised& at, std::size_t joint, const LinearFit& fit, const MatrixXd& all_features) {
  LackOfFit out;
  const auto k = static_cast<Index>(joint);
  const double w = fit.rows[k] / std::max(fit.square[k], 1e-12 * fit.rows[k] / at.weights()[k]);
  const VectorXd residual = at.residual(joint, fit);
  if (fit.square[k] * at.weights()[k] < 1e-10 * fit.rows[k]) return out;
  const VectorXd e = only(at, residual, at.fit_blocks());
  const MatrixXd f = only(at, joint, all_features, at.fit_blocks());
  const JointRows& rows = at.rows(joint);
  MatrixXd cross = MatrixXd::Zero(static_cast<Index>(fit.columns.size()), f.cols());
  MatrixXd surrogate = shifted(at, joint, e, at.fit_blocks());
  MatrixXd theirs = MatrixXd::Zero(static_cast<Index>(fit.columns.size()), surrogate.cols());
  for (std::size_t i = 0; i < fit.columns.size(); ++i) {
    const Index local = rows.local[static_cast<std::size_t>(fit.columns[i])];
    if (local < 0) continue;
    cross.row(static_cast<Index>(i)) = w * rows.x.col(local).transpose() * f;
    theirs.row(static_cast<Index>(i)) = w * rows.x.col(local).transpose() * surrogate;
  }
  const MatrixXd z = SymmetricSolver(fit.information).inverse() * cross;
  MatrixXd gram = w * (f.transpose() * f) - cross.transpose() * z;
  // What the background takes of them.
  const Background* background = at.background(joint);
  MatrixXd taken;  // functions x features
  if (background != nullptr) {
    const MatrixXd products = background->b.transpose() * f;
    taken = w * background->inverse * products;
    gram -= products.transpose() * taken;
  }
  const VectorXd size = (w * f.colwise().squaredNorm().transpose().array()).max(1e-300).sqrt().inverse();
  gram = size.asDiagonal() * gram * size.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(gram);
  std::vector<Index> kept;
  for (Index i = 0; i < gram.rows(); ++i) {
    if (eigen.eigenvalues()[i] > 1e-4) kept.push_back(i);
  }
  const MatrixXd basis = eigen.eigenvectors()(Eigen::all, kept);
  const VectorXd inverse = eigen.eigenvalues()(kept).cwiseInverse();
  const auto statistic = [&](const VectorXd& b) {
    const VectorXd along = basis.transpose() * size.cwiseProduct(b);
    return along.cwiseAbs2().dot(inverse);
  };
  const double mine = statistic(w * f.transpose() * e);
  MatrixXd b = w * (f.transpose() * surrogate) - z.transpose() * theirs;
  if (background != nullptr) b -= taken.transpose() * (background->b.transpose() * surrogate);
  VectorXd null(surrogate.cols());
  for (Index s = 0; s < null.size(); ++s) null[s] = statistic(b.col(s));
  const double mean = null.mean(),
               variance = (null.array() - mean).square().sum() / static_cast<double>(null.size() - 1);
  const double freedom =
      std::clamp(2 * mean * mean / std::max(variance, 1e-300), 3.0, static_cast<double>(kept.size()));
  // Shares of the residual: with few rows noise alone fills many of its directions.
  const double whole = w * e.squaredNorm();
  auto fitted = static_cast<double>(background != nullptr ? background->b.cols() : 0);
  for (const Index c : fit.columns) fitted += rows.local[static_cast<std::size_t>(c)] >= 0 ? 1 : 0;
  double today = 0;
  for (const std::size_t i : at.fit_blocks()) {
    if (!at.blocks()[i].healthy) today += static_cast<double>(at.blocks()[i].count);
  }
  // The columns are fitted to both sessions; today's rows bear their share of them.
  const double rest = today - fitted * today / fit.rows[k] - static_cast<double>(kept.size());
  const auto odds = [&](double part) { return part / std::max(whole - part, 1e-9 * whole); };
  // With hardly more rows than functions nothing can be told.
  if (rest > 0.3 * static_cast<double>(kept.size()))
    out.state_p = chance(odds(mine) / std::max(odds(mean), 1e-300), freedom, rest);
  out.time_p = std::min(lines(at, residual, at.fit_blocks()).p,
                        at.models().has_baseline ? slow(at, residual, at.fit_blocks()).p : 1.0);
  return out;
}

double structured_share(const Linearised& at, std::size_t joint, const LinearFit& fit, const MatrixXd& all_features,
                        const std::vector<std::size_t>& blocks) {
  const VectorXd e = only(at, at.residual(joint, fit), blocks);
  const MatrixXd f = only(at, joint, all_features, blocks);
  Index count = 0;
  for (const std::size_t b : blocks) count += at.blocks()[b].healthy ? 0 : at.blocks()[b].count;
  if (!(e.squaredNorm() > 0) || 2 * count < 3 * f.cols()) return 0;
  const VectorXd size = f.colwise().norm().transpose().array().max(1e-300).inverse();
  const MatrixXd gram = size.asDiagonal() * (f.transpose() * f) * size.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(gram);
  // Coefficients of an orthonormal basis.
  const auto coordinates = [&](const VectorXd& x) {
    VectorXd along = eigen.eigenvectors().transpose() * size.cwiseProduct(f.transpose() * x);
    for (Index i = 0; i < along.size(); ++i)
      along[i] = eigen.eigenvalues()[i] > 1e-4 ? along[i] / std::sqrt(eigen.eigenvalues()[i]) : 0;
    return along;
  };
  const auto energy = [&](const VectorXd& x) { return coordinates(x).squaredNorm(); };
  const MatrixXd surrogate = shifted(at, joint, e, blocks);
  double null = 0;
  for (Index s = 0; s < surrogate.cols(); ++s) null += energy(surrogate.col(s)) / static_cast<double>(surrogate.cols());
  const double whole = e.squaredNorm(), found = energy(e), expected = std::min(null / whole, 0.95);
  // found = structure + expected * (whole - structure)
  const double of_state = std::clamp((found / whole - expected) / (1 - expected), 0.0, 1.0);
  // What the state does not explain may still repeat or wander.
  VectorXd along = coordinates(e);
  for (Index i = 0; i < along.size(); ++i) {
    if (eigen.eigenvalues()[i] > 1e-4) along[i] /= std::sqrt(eigen.eigenvalues()[i]);
  }
  const VectorXd rest = e - f * size.cwiseProduct(eigen.eigenvectors() * along);
  const double of_time =
      std::max(lines(at, rest, blocks).share,
               at.models().has_baseline ? slow(at, rest + (at.residual(joint, fit) - e), blocks).share : 0.0);
  return of_state + (1 - of_state) * std::clamp(of_time, 0.0, 1.0);
}

}  // namespace fxdyn::diagnosis
