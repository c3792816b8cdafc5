#include "host_tools/diagnose/lack_of_fit.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <complex>
#include <numbers>
#include <unsupported/Eigen/FFT>

#include "host_tools/effects/effects.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/support/random.hpp"
#include "model/effects/presliding.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int random_features = 24;
constexpr int draws = 64;

/// What stands for noise on the rows in `blocks`, one column a draw: pieces of the healthy session's residual. Where
/// there is little of it, or it has structure of its own, the residual of the same block at other times, which is more
/// than noise as it holds what is looked for.
MatrixXd stand_ins(const Linearised& at, std::size_t joint, const VectorXd& e, const VectorXd& healthy_residual,
                   const std::vector<std::size_t>& blocks) {
  Random random(4177 + joint);
  MatrixXd out = MatrixXd::Zero(e.size(), draws);
  std::vector<double> stock;
  for (const std::size_t i : at.fit_blocks()) {
    const Block& b = at.blocks()[i];
    if (b.healthy && at.background(joint) == nullptr)
      stock.insert(stock.end(), healthy_residual.data() + b.first, healthy_residual.data() + b.first + b.count);
  }
  const std::size_t size = stock.size();
  for (const std::size_t i : blocks) {
    const Block& b = at.blocks()[i];
    for (int k = 0; k < draws; ++k) {
      if (2 * size >= static_cast<std::size_t>(b.count)) {
        const auto from = static_cast<std::size_t>(random.uniform() * static_cast<double>(size));
        for (Index row = 0; row < b.count; ++row)
          out(b.first + row, k) = stock[(from + static_cast<std::size_t>(row)) % size];
      } else {
        const auto by = static_cast<Index>(random.uniform(0.08, 0.92) * static_cast<double>(b.count));
        out.block(b.first, k, b.count - by, 1) = e.segment(b.first + by, b.count - by);
        out.block(b.first + b.count - by, k, by, 1) = e.segment(b.first, by);
      }
    }
  }
  return out;
}

VectorXd only(const Linearised& at, const VectorXd& e, const std::vector<std::size_t>& blocks, bool healthy = false) {
  VectorXd out = VectorXd::Zero(e.size());
  for (const std::size_t i : blocks) {
    const Block& b = at.blocks()[i];
    if (b.healthy == healthy) out.segment(b.first, b.count) = e.segment(b.first, b.count);
  }
  return out;
}

/// Features on one session's rows. Where the encoder does not tell which way the joint moves they are zero: friction's
/// mean over what the velocity may be is a smoother function of it than friction is, and that is no structure of the
/// robot.
MatrixXd only(const Linearised& at, std::size_t joint, const MatrixXd& x, const std::vector<std::size_t>& blocks,
              bool healthy = false) {
  MatrixXd out = MatrixXd::Zero(x.rows(), x.cols());
  for (const std::size_t i : blocks) {
    const Block& b = at.blocks()[i];
    if (b.healthy != healthy) continue;
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

/// Waves over the recorded range: of another joint's position, of the own one, of friction over the own one.
constexpr Index other_waves = 6, own_waves = 8, friction_waves = 10;
/// Functions of another joint's velocity; of the own motion and load, the first of them of the motion alone.
constexpr Index of_other_velocity = 3, of_own = 14, of_own_motion = 10;

/// Columns of features() that belong together.
struct Family {
  Index first, count;
};

/// In the order of the columns: each other joint's position, all their velocities, own position, own motion and load,
/// friction over the own position, random features (none of a family), friction over a session's rows in their order.
/// Those that know nothing but the motion come first.
std::vector<Family> families(std::size_t joints) {
  std::vector<Family> out;
  Index at = 0;
  const auto add = [&](Index count) {
    if (count > 0) out.push_back({at, count});
    at += count;
  };
  const auto others = static_cast<Index>(joints) - 1;
  for (Index k = 0; k < others; ++k) add(other_waves);
  add(of_other_velocity * others);
  add(own_waves);
  add(of_own);
  add(friction_waves);
  at += random_features;
  add(time_features);
  return out;
}

/// cos(m pi u), m = 1..count.
void add_waves(std::vector<Eigen::ArrayXd>& columns, const Eigen::ArrayXd& u, Index count,
               const Eigen::ArrayXd& times) {
  for (Index m = 1; m <= count; ++m) columns.push_back((static_cast<double>(m) * std::numbers::pi * u).cos() * times);
}

/// Projection on functions, as a statistic of any subset of them.
class Projection {
 public:
  /// @param gram of the functions once what is fitted has been taken out; size: their norms before
  Projection(const MatrixXd& gram, const VectorXd& size, const Family& of)
      : size_(size.segment(of.first, of.count)), of_(of) {
    const auto scale = size_.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scale * gram.block(of.first, of.first, of.count, of.count) *
                                                        scale);
    std::vector<Index> kept;
    for (Index i = 0; i < of.count; ++i) {
      if (eigen.eigenvalues()[i] > 1e-4) kept.push_back(i);
    }
    basis_ = eigen.eigenvectors()(Eigen::all, kept) * eigen.eigenvalues()(kept).cwiseSqrt().cwiseInverse().asDiagonal();
  }
  Index rank() const { return basis_.cols(); }
  /// Coordinates of an orthonormal basis, of products with all functions.
  VectorXd coordinates(const VectorXd& products) const {
    return basis_.transpose() * size_.cwiseProduct(products.segment(of_.first, of_.count));
  }
  /// Coefficients of the functions, of coordinates.
  VectorXd coefficients(const VectorXd& along) const { return size_.cwiseProduct(basis_ * along); }
  double operator()(const VectorXd& products) const { return coordinates(products).squaredNorm(); }

 private:
  VectorXd size_;
  Family of_;
  MatrixXd basis_;
};

/// x^T of the columns of a fit, weighed.
MatrixXd times_columns(const Linearised& at, std::size_t joint, const LinearFit& fit, double w, const MatrixXd& x) {
  const JointRows& rows = at.rows(joint);
  MatrixXd out = MatrixXd::Zero(static_cast<Index>(fit.columns.size()), x.cols());
  for (std::size_t i = 0; i < fit.columns.size(); ++i) {
    const Index local = rows.local[static_cast<std::size_t>(fit.columns[i])];
    if (local >= 0) out.row(static_cast<Index>(i)) = w * rows.x.col(local).transpose() * x;
  }
  return out;
}

/// The functions on one session's rows, as what is fitted leaves them, and their products with the residual. Of the
/// healthy session a background is left in both: how much it is, is asked.
struct Products {
  MatrixXd functions{};  ///< as they are, rows x functions
  MatrixXd gram{};
  MatrixXd fitted{}, taken{};  ///< what the columns, the background take of them
  VectorXd size{}, residual{};
  double whole = 0, rows = 0;  ///< squared residual; how many rows
};

Products products(const Linearised& at, std::size_t joint, const LinearFit& fit, double w, const VectorXd& residual,
                  const MatrixXd& all_features, bool healthy) {
  Products out;
  out.functions = only(at, joint, all_features, at.fit_blocks(), healthy);
  const MatrixXd& f = out.functions;
  const VectorXd e = only(at, residual, at.fit_blocks(), healthy);
  const MatrixXd cross = times_columns(at, joint, fit, w, f);
  out.fitted = SymmetricSolver(fit.information).inverse() * cross;
  out.gram = w * (f.transpose() * f) - cross.transpose() * out.fitted;
  if (const Background* background = at.background(joint); background != nullptr && !healthy) {
    const MatrixXd with = background->b.transpose() * f;
    out.taken = w * background->inverse * with;
    out.gram -= with.transpose() * out.taken;
  }
  out.size = (w * f.colwise().squaredNorm().transpose().array()).max(1e-300).sqrt().inverse();
  out.residual = w * f.transpose() * e;
  out.whole = w * e.squaredNorm();
  for (const std::size_t i : at.fit_blocks()) {
    if (at.blocks()[i].healthy == healthy) out.rows += static_cast<double>(at.blocks()[i].count);
  }
  return out;
}

}  // namespace

MatrixXd features(const Linearised& at, std::size_t joint, bool healthy) {
  const std::size_t n = at.joints();
  const auto j = static_cast<Index>(joint);
  MatrixXd out;
  const Index total = at.log_rows(at.logs().size() - 1).first + at.log_rows(at.logs().size() - 1).count;
  const auto joints = static_cast<Index>(n);
  Eigen::ArrayXd speed = Eigen::ArrayXd::Zero(joints), acceleration = speed, load = speed,
                 low = Eigen::ArrayXd::Constant(joints, 1e300), high = -low;
  // Scales are those of the logs that fit, which every linearisation has: rows that are kept stay true.
  Index fitted[2] = {0, 0};  // rows of the session: today's, the healthy one's
  for (std::size_t l = 0; l < at.logs().size(); ++l) {
    if (!at.logs()[l].fits) continue;
    const ProcessedLog& log = at.logs()[l].log;
    const auto inside = [&](const MatrixXd& m) { return m.middleRows(log.first, log.last - log.first).array(); };
    const auto most = [&](const MatrixXd& m) { return inside(m).abs().colwise().maxCoeff().transpose().eval(); };
    speed = speed.max(most(at.motion(l).dq));
    acceleration = acceleration.max(most(at.motion(l).ddq));
    load = load.max(most(at.robot_columns(l).structural()));
    low = low.min(inside(at.motion(l).q).colwise().minCoeff().transpose());
    high = high.max(inside(at.motion(l).q).colwise().maxCoeff().transpose());
    fitted[at.logs()[l].healthy] += at.log_rows(l).count;
  }
  speed = speed.max(1e-9);
  acceleration = acceleration.max(1e-9);
  load = load.max(1e-9);
  const Eigen::ArrayXd range = (high - low).max(1e-9);
  const bool turns = at.models().current.robot.joints[joint].type == JointType::revolute;
  const double sign_width = at.models().current.joints[joint].sign_width;
  VectorXd motion_scales(4 * joints), model_scales(joints + 3);
  motion_scales << speed, acceleration, low, range;
  model_scales << load, sign_width, 0, 0;
  const Index of_motion = other_waves * (joints - 1) + of_other_velocity * (joints - 1) + own_waves + of_own_motion;
  // Rows of the session before a log. Those that judge come after those that fit.
  Index fits_before[2] = {0, 0}, judges_before[2] = {fitted[0], fitted[1]};
  for (std::size_t l = 0; l < at.logs().size(); ++l) {
    const SessionLog& entry = at.logs()[l];
    if (entry.healthy && !healthy) continue;
    const ProcessedLog& log = entry.log;
    const Index count = at.log_rows(l).count;
    Index& before = (entry.fits ? fits_before : judges_before)[entry.healthy];
    const auto first = static_cast<double>(before), whole = static_cast<double>(fitted[entry.healthy]);
    const double begins = first / whole, lasts = static_cast<double>(count) / whole;
    model_scales.tail(2) << first, whole;
    before += count;
    const Motion& m = at.motion(l);
    const Index samples = m.q.rows();
    const Eigen::ArrayXd dq = m.dq.col(j) / speed[j], ddq = m.ddq.col(j) / acceleration[j],
                         one = Eigen::ArrayXd::Ones(samples);
    const auto place = [&](Index k) -> Eigen::ArrayXd { return (m.q.col(k).array() - low[k]) / range[k]; };
    std::vector<Eigen::ArrayXd> columns;
    const auto keep = [&](RowCache::Features& in, const VectorXd& scales) {
      MatrixXd full(samples, static_cast<Index>(columns.size()));
      for (std::size_t c = 0; c < columns.size(); ++c) full.col(static_cast<Index>(c)) = columns[c];
      columns.clear();
      in = {scales, log.decimate(log.filter_columns(full))};
    };
    auto& [kept_motion, kept_model] = entry.cache->features[joint];
    if (kept_motion.scales.size() == 0 || kept_motion.scales != motion_scales) {
      for (Index k = 0; k < joints; ++k) {
        if (k != j) add_waves(columns, place(k), other_waves, one);
      }
      for (Index k = 0; k < joints; ++k) {
        if (k == j) continue;
        const Eigen::ArrayXd dqk = m.dq.col(k).array() / speed[k];
        columns.push_back((dqk * 40).tanh());
        columns.push_back(dqk);
        columns.push_back(dq * dqk);
      }
      add_waves(columns, place(j), own_waves, one);
      for (const double width : {0.01, 0.03, 0.1, 0.3}) {
        columns.push_back((dq / width).tanh());
        columns.push_back((dq / width).tanh().abs());
      }
      columns.push_back(ddq);
      columns.push_back(ddq * ddq.abs());
      keep(kept_motion, motion_scales);
      kept_model.scales.resize(0);
    }
    // The load moves a little with each fit; these functions need not.
    if (kept_model.scales.size() == 0 ||
        !((kept_model.scales - model_scales).array().abs() <= 0.05 * model_scales.array().abs()).all()) {
      const Eigen::ArrayXd tau = at.robot_columns(l).structural().col(j).array() / load[j],
                           sign = (m.dq.col(j).array() / sign_width).tanh();
      columns.push_back(tau);
      columns.push_back(tau * (dq * 40).tanh());
      for (const double distance : {1e-3, 5e-3}) {
        const JointSeries series{m.q.col(j), m.dq.col(j), m.ddq.col(j), {}, m.step_s};
        columns.push_back(
            effect_columns(Presliding::name, std::array{turns ? distance : 0.1 * distance}, sign_width, series)
                .col(0)
                .array());
      }
      add_waves(columns, place(j), friction_waves, sign);
      const double scale = turns ? 0.5 : 5.0;
      const Eigen::ArrayXd slowest = (dq / 0.02).asinh();
      Random random(91 + joint);
      for (int r = 0; r < random_features; ++r) {
        const double a = 3 * random.normal(), b = 3 * random.normal(), c = 1.5 * random.normal(), d = random.normal(),
                     e = 2 * std::numbers::pi * random.uniform(), f = 2 * random.normal();
        columns.push_back((a * scale * m.q.col(j).array() + b * dq + c * slowest + d * ddq + f * tau + e).cos());
      }
      add_waves(columns, begins + lasts * Eigen::ArrayXd::LinSpaced(samples, 0, 1), time_features, sign);
      keep(kept_model, model_scales);
    }
    const Index cols = of_motion + kept_model.rows.cols();
    assert(kept_motion.rows.cols() == of_motion && cols == families(n).back().first + families(n).back().count);
    if (out.size() == 0) out.setZero(total, cols);
    out.block(at.log_rows(l).first, 0, count, of_motion) = at.finish(l, joint, kept_motion.rows);
    out.block(at.log_rows(l).first, of_motion, count, cols - of_motion) = at.finish(l, joint, kept_model.rows);
  }
  return out;
}

LackOfFit lack_of_fit(const Linearised& at, std::size_t joint, const LinearFit& fit, const LinearFit* alone,
                      const MatrixXd& all_features) {
  LackOfFit out;
  const auto k = static_cast<Index>(joint);
  const double w = fit.rows[k] / std::max(fit.square[k], 1e-12 * fit.rows[k] / at.weights()[k]);
  const VectorXd residual = at.residual(joint, fit);
  if (fit.square[k] * at.weights()[k] < 1e-10 * fit.rows[k]) return out;
  const Background* background = at.background(joint);
  const Products today = products(at, joint, fit, w, residual, all_features, false);
  // Fitted on its own: what today's structure does to common parameters is not the healthy session's.
  Products before;
  VectorXd healthy = residual;
  if (alone != nullptr) {
    healthy = at.residual_with_background(joint, *alone);
    before = products(at, joint, *alone, at.weights()[k], healthy, all_features, true);
  }
  // Stand-ins, in both sessions, have been fitted by nothing yet.
  const MatrixXd noise = stand_ins(at, joint, residual, healthy, at.fit_blocks());
  MatrixXd theirs =
      w * (today.functions.transpose() * noise) - today.fitted.transpose() * times_columns(at, joint, fit, w, noise);
  if (background != nullptr) theirs -= today.taken.transpose() * (background->b.transpose() * noise);
  double mean_noise = 0;
  for (const std::size_t i : at.fit_blocks()) {
    const Block& b = at.blocks()[i];
    if (!b.healthy) mean_noise += w * noise.middleRows(b.first, b.count).squaredNorm() / draws;
  }
  auto fitted = static_cast<double>(background != nullptr ? background->b.cols() : 0);
  for (const Index c : fit.columns) fitted += at.rows(joint).local[static_cast<std::size_t>(c)] >= 0 ? 1 : 0;
  // Shares of the residual: with few rows noise alone fills many of its directions.
  const auto odds = [](double part, double of) { return part / std::max(of - part, 1e-9 * of); };
  const auto chance_of = [&](const Family& family) {
    const Projection statistic(today.gram, today.size, family);
    const auto rank = static_cast<double>(statistic.rank());
    // The columns are fitted to both sessions; today's rows bear their share of them.
    const double rest = today.rows - fitted * today.rows / fit.rows[k] - rank;
    // With hardly more rows than functions nothing can be told.
    if (rank == 0 || rest <= 0.3 * rank) return 1.0;
    VectorXd null(draws);
    for (Index s = 0; s < null.size(); ++s) null[s] = statistic(theirs.col(s));
    const double mean = null.mean(),
                 variance = (null.array() - mean).square().sum() / static_cast<double>(null.size() - 1);
    const double freedom = std::clamp(2 * mean * mean / std::max(variance, 1e-300), 1.0, rank);
    double expected = odds(mean, mean_noise), known_by = rest;
    // What the healthy session has of it beyond noise (friction near standstill, where the velocity is uncertain, or a
    // background that another motion shows otherwise) is no change: the same share, however many rows there are.
    if (before.rows > 0) {
      const Projection then(before.gram, before.size, family);
      const auto also = static_cast<double>(then.rank());
      const double beyond =
          std::max(0.0, odds(then(before.residual), before.whole) - also / std::max(before.rows - also, 1.0));
      expected = std::max(expected, rank / rest + beyond);
      // A background is known as well as so many of its functions tell it, not rows.
      if (background != nullptr)
        known_by = expected * expected / (expected * expected / rest + beyond * beyond / freedom);
    }
    return chance(odds(statistic(today.residual), today.whole) / std::max(expected, 1e-300), freedom, known_by);
  };
  // All functions together see anything; a family sees its own kind where it is small.
  const std::vector<Family> all = families(at.joints());
  out.state_p = chance_of({0, all_features.cols()});
  for (const Family& family : all) {
    out.state_p = std::min(out.state_p, static_cast<double>(all.size()) * chance_of(family));
  }
  out.time_p = std::min(lines(at, residual, at.fit_blocks()).p,
                        at.models().has_baseline ? slow(at, residual, at.fit_blocks()).p : 1.0);
  return out;
}

double structured_share(const Linearised& at, std::size_t joint, const LinearFit& fit, const MatrixXd& all_features,
                        const std::vector<std::size_t>& blocks, bool healthy) {
  const VectorXd residual = at.residual(joint, fit), e = only(at, residual, blocks, healthy);
  const MatrixXd f = only(at, joint, all_features, blocks, healthy);
  Index count = 0;
  for (const std::size_t b : blocks) count += at.blocks()[b].healthy == healthy ? at.blocks()[b].count : 0;
  if (!(e.squaredNorm() > 0)) return 0;
  const VectorXd size = f.colwise().norm().transpose().array().max(1e-300).inverse();
  const MatrixXd gram = f.transpose() * f, noise = stand_ins(at, joint, residual, residual, blocks),
                 theirs = f.transpose() * noise;
  const VectorXd mine = f.transpose() * e;
  const double whole = e.squaredNorm();
  // found = structure + expected * (whole - structure)
  const auto share_of = [&](const Projection& energy) {
    if (2 * count < 3 * energy.rank()) return 0.0;  // too few rows to tell
    double null = 0;
    for (Index s = 0; s < theirs.cols(); ++s) null += energy(theirs.col(s));
    const double found = energy(mine), expected = std::min(null / std::max(noise.squaredNorm(), 1e-300), 0.95);
    return std::clamp((found / whole - expected) / (1 - expected), 0.0, 1.0);
  };
  const Projection all(gram, size, {0, f.cols()});
  double of_state = share_of(all);
  for (const Family& family : families(at.joints()))
    of_state = std::max(of_state, share_of(Projection(gram, size, family)));
  if (healthy) return of_state;
  // What the state does not explain may still repeat or wander.
  const VectorXd rest = 2 * count < 3 * all.rank() ? e : e - f * all.coefficients(all.coordinates(mine));
  const double of_time = std::max(lines(at, rest, blocks).share,
                                  at.models().has_baseline ? slow(at, rest + (residual - e), blocks).share : 0.0);
  return of_state + (1 - of_state) * std::clamp(of_time, 0.0, 1.0);
}

}  // namespace fxdyn::diagnosis
