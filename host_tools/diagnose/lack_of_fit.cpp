#include "host_tools/diagnose/lack_of_fit.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/diagnose/shifted_residual.hpp"
#include "host_tools/diagnose/time_structure.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A numeric choice: draws from which mean and variance of noise's statistics are taken.
constexpr int draws = 64;
/// Eigenvalue of a Gram matrix of columns of size 1: a direction with less is rounding of the others.
constexpr double dependent_direction = 1e-4;
/// A numeric floor under the residual's variance, of that at the start: data without noise.
constexpr double noise_free = 1e-12, no_variance_left = 1e-10;
/// Noise's share of a direction at most, so that the rest can be divided by.
constexpr double most_expected = 0.95;

/// What stands for noise on the rows in `blocks`, one column a draw: pieces of the healthy session's residual. Where
/// there is little of it, or it has structure of its own, the residual of the same block at other times, which is more
/// than noise as it holds what is looked for.
MatrixXd stand_ins(const Linearised& problem, std::size_t joint, const VectorXd& e, const VectorXd& healthy_residual,
                   const std::vector<std::size_t>& blocks) {
  Random random(4177 + joint);
  MatrixXd out = MatrixXd::Zero(e.size(), draws);
  std::vector<double> stock;
  for (const std::size_t i : problem.blocks().fit) {
    const Block& b = problem.blocks().all[i];
    if (b.healthy && problem.background(joint) == nullptr)
      stock.insert(stock.end(), healthy_residual.data() + b.first, healthy_residual.data() + b.first + b.count);
  }
  const std::size_t size = stock.size();
  for (const std::size_t i : blocks) {
    const Block& b = problem.blocks().all[i];
    for (int k = 0; k < draws; ++k) {
      if (2 * size >= static_cast<std::size_t>(b.count)) {
        const auto from = static_cast<std::size_t>(random.uniform() * static_cast<double>(size));
        for (Index row = 0; row < b.count; ++row)
          out(b.first + row, k) = stock[(from + static_cast<std::size_t>(row)) % size];
      } else {
        shift(random, e, b, out.col(k));
      }
    }
  }
  return out;
}

VectorXd only(const Linearised& problem, const VectorXd& e, const std::vector<std::size_t>& blocks,
              bool healthy = false) {
  VectorXd out = VectorXd::Zero(e.size());
  for (const std::size_t i : blocks) {
    const Block& b = problem.blocks().all[i];
    if (b.healthy == healthy) out.segment(b.first, b.count) = e.segment(b.first, b.count);
  }
  return out;
}

/// Features on one session's rows. Where the encoder does not show which way the joint moves they are zero: friction's
/// mean over what the velocity may be is a smoother function of it than friction is, and that is no structure of the
/// robot.
MatrixXd only(const Linearised& problem, std::size_t joint, const MatrixXd& x, const std::vector<std::size_t>& blocks,
              bool healthy = false) {
  MatrixXd out = MatrixXd::Zero(x.rows(), x.cols());
  for (const std::size_t i : blocks) {
    const Block& b = problem.blocks().all[i];
    if (b.healthy != healthy) continue;
    for (Index row = b.first; row < b.first + b.count; ++row) {
      if (!problem.noise().is_doubtful(joint, row)) out.row(row) = x.row(row);
    }
  }
  return out;
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
      if (eigen.eigenvalues()[i] > dependent_direction) kept.push_back(i);
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
  /// Coefficients of the functions in each vector of an orthonormal basis.
  MatrixXd basis() const { return size_.asDiagonal() * basis_; }

 private:
  VectorXd size_;
  Family of_;
  MatrixXd basis_;
};

/// x^T of the columns of a fit, weighed.
MatrixXd times_columns(const Linearised& problem, std::size_t joint, const LinearFit& fit, double w,
                       const MatrixXd& x) {
  const JointRows& rows = problem.solver().rows(joint);
  MatrixXd out = MatrixXd::Zero(static_cast<Index>(fit.columns.size()), x.cols());
  for (std::size_t i = 0; i < fit.columns.size(); ++i) {
    const Index local = rows.place(fit.columns[i]);
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

Products products(const Linearised& problem, std::size_t joint, const LinearFit& fit, double w,
                  const VectorXd& residual, const MatrixXd& all_features, bool healthy) {
  Products out;
  const std::vector<std::size_t>& blocks = problem.blocks().fit;
  out.functions = only(problem, joint, all_features, blocks, healthy);
  const MatrixXd& f = out.functions;
  const VectorXd e = only(problem, residual, blocks, healthy);
  const MatrixXd cross = times_columns(problem, joint, fit, w, f);
  out.fitted = SymmetricSolver(fit.information).inverse() * cross;
  out.gram = w * (f.transpose() * f) - cross.transpose() * out.fitted;
  if (const Background* background = problem.background(joint); background != nullptr && !healthy) {
    const MatrixXd with = background->functions().transpose() * f;
    out.taken = w * background->inverse() * with;
    out.gram -= with.transpose() * out.taken;
  }
  out.size = (w * f.colwise().squaredNorm().transpose().array()).max(1e-300).sqrt().inverse();
  out.residual = w * f.transpose() * e;
  out.whole = w * e.squaredNorm();
  if (healthy && problem.background(joint) != nullptr) {
    // A background is eliminated over both sessions. On these rows alone what is left of it has some of the columns,
    // which the functions' products lack.
    const VectorXd along = times_columns(problem, joint, fit, w, e);
    out.residual -= out.fitted.transpose() * along;
    out.whole -= along.dot(SymmetricSolver(fit.information).solve(along));
  }
  for (const std::size_t i : blocks) {
    if (problem.blocks().all[i].healthy == healthy) out.rows += static_cast<double>(problem.blocks().all[i].count);
  }
  return out;
}

/// Whitened residual of a joint with what its background explains still in it.
VectorXd residual_with_background(const Linearised& problem, std::size_t joint, const LinearFit& fit) {
  VectorXd e = problem.solver().residual(joint, fit);
  const Background* background = problem.background(joint);
  if (background == nullptr) return e;
  return e - background->part(problem.solver().extra_residual(joint, fit));
}

/// A residual where the encoder shows which way the joint moves, else zero: friction of an unknown sign repeats with
/// the motion, and is no structure of the robot.
VectorXd without_doubt(const Linearised& problem, std::size_t joint, VectorXd residual) {
  for (Index row = 0; row < residual.size(); ++row) {
    if (problem.noise().is_doubtful(joint, row)) residual[row] = 0;
  }
  return residual;
}

/// What of a residual repeats or wanders: the clearer of the two.
/// @param with_healthy the residual with the healthy session's rows in it
TimeStructure in_time(const Linearised& problem, std::size_t joint, const VectorXd& residual,
                      const std::vector<std::size_t>& blocks, const VectorXd& with_healthy) {
  const LackOfFitOptions& options = problem.options().lack_of_fit;
  TimeStructure out =
      spectral_lines(problem.logs(), problem.blocks(), without_doubt(problem, joint, residual), blocks, options);
  if (!problem.has_baseline()) return out;
  const TimeStructure slow =
      slow_changes(problem.logs(), problem.blocks(), without_doubt(problem, joint, with_healthy), blocks, options);
  return {std::min(out.p, slow.p), std::max(out.share, slow.share)};
}

/// One over the variance of what a fit leaves of a joint.
double weight(const Linearised& problem, std::size_t joint, const LinearFit& fit) {
  const auto k = static_cast<Index>(joint);
  return fit.rows[k] / std::max(fit.square[k], noise_free * fit.rows[k] / problem.solver().weights()[k]);
}

/// Shares of the residual: with few rows noise alone fills many of its directions.
double odds(double part, double of) { return part / std::max(of - part, 1e-9 * of); }

/// How much of today's residual of a joint is a function of its state, against what noise, the healthy
/// session and the encoder's steps make of that.
class StateTest {
 public:
  StateTest(const Linearised& problem, std::size_t joint, const LinearFit& fit, const LinearFit* alone,
            const MatrixXd& features, const VectorXd& residual)
      : problem_(problem),
        joint_(joint),
        fit_(fit),
        w_(weight(problem, joint, fit)),
        rows_of_fit_(fit.rows[static_cast<Index>(joint)]),
        today_(products(problem, joint, fit, w_, residual, features, false)) {
    // Fitted on its own: what today's structure does to common parameters is not the healthy session's.
    VectorXd healthy = residual;
    if (alone != nullptr) {
      healthy = residual_with_background(problem, joint, *alone);
      before_ = products(problem, joint, *alone, problem.solver().weights()[static_cast<Index>(joint)], healthy,
                         features, true);
    }
    // Stand-ins, in both sessions, have been fitted by nothing yet.
    const MatrixXd noise = stand_ins(problem, joint, residual, healthy, problem.blocks().fit);
    of_noise_ = unfitted(noise);
    for_each_of_today(
        [&](const Block& b) { mean_noise_ += w_ * noise.middleRows(b.first, b.count).squaredNorm() / draws; });
    const Background* background = problem.background(joint);
    fitted_ = static_cast<double>(background != nullptr ? background->functions().cols() : 0);
    for (const Index c : fit.columns) fitted_ += problem.solver().rows(joint).place(c) >= 0 ? 1 : 0;
  }

  /// What the encoder's steps make counts as expected from now on. @returns whether they make anything
  bool expect_encoder_errors() {
    const Linearised* seen = problem_.through_encoders();
    if (seen == nullptr) return false;
    const LinearFit fit = seen->solver().solve(seen->columns_of(in_model(*seen)));
    w_seen_ = weight(*seen, joint_, fit);
    seen_ = products(*seen, joint_, fit, w_seen_, seen->solver().residual(joint_, fit),
                     features(*seen, joint_, seen->has_baseline()), false);
    return true;
  }

  /// All functions together see anything; a family sees its own kind where it is small (Bonferroni).
  double smallest_chance() const {
    const std::vector<Family> all = families(problem_.joints());
    double smallest = chance_of({0, of_noise_.rows()});
    for (const Family& family : all) smallest = std::min(smallest, static_cast<double>(all.size()) * chance_of(family));
    return smallest;
  }

  /// Of families other than the own motion's, once its functions have taken their part of all. Random functions are of
  /// no family.
  double smallest_chance_elsewhere() {
    std::vector<Family> all = families(problem_.joints());
    const Family own = all[place_of_own_motion(problem_.joints())];
    all.erase(all.begin() + static_cast<std::ptrdiff_t>(place_of_own_motion(problem_.joints())));
    const MatrixXd basis = Projection(today_.gram, today_.size, own).basis();
    const MatrixXd of_own = basis.transpose() * of_noise_.middleRows(own.first, own.count);
    of_noise_ -= today_.gram.middleCols(own.first, own.count) * basis * of_own;
    mean_noise_ -= of_own.colwise().squaredNorm().mean();
    for (Products* session : {&today_, &before_, &seen_}) {
      if (session->rows > 0) take_off(own, *session);
    }
    double smallest = 1;
    for (const Family& family : all) smallest = std::min(smallest, static_cast<double>(all.size()) * chance_of(family));
    return smallest;
  }

 private:
  /// What is expected of a statistic, as a share; how many free numbers one of it has, and it is known by.
  struct Expected {
    double share = 0, freedom = 0, known_by = 0;
  };

  /// What functions of a family explain of one session's residual and of all other functions.
  static void take_off(const Family& family, Products& of) {
    const MatrixXd basis = Projection(of.gram, of.size, family).basis();
    const MatrixXd along = of.gram.middleCols(family.first, family.count) * basis;
    const VectorXd explained = basis.transpose() * of.residual.segment(family.first, family.count);
    of.residual -= along * explained;
    of.gram -= along * along.transpose();
    of.whole -= explained.squaredNorm();
    of.rows -= static_cast<double>(basis.cols());
  }
  template <class Do>
  void for_each_of_today(Do&& each) const {
    for (const std::size_t i : problem_.blocks().fit) {
      const Block& b = problem_.blocks().all[i];
      if (!b.healthy) each(b);
    }
  }
  /// Products of the functions with rows that nothing was fitted to yet, as the fit would leave them.
  MatrixXd unfitted(const MatrixXd& rows) const {
    MatrixXd out = w_ * (today_.functions.transpose() * rows) -
                   today_.fitted.transpose() * times_columns(problem_, joint_, fit_, w_, rows);
    if (const Background* background = problem_.background(joint_); background != nullptr)
      out -= today_.taken.transpose() * (background->functions().transpose() * rows);
    return out;
  }

  double chance_of(const Family& family) const {
    const Projection statistic(today_.gram, today_.size, family);
    const auto rank = static_cast<double>(statistic.rank());
    // The columns are fitted to both sessions; today's rows bear their share of them.
    const double rest = today_.rows - fitted_ * today_.rows / rows_of_fit_ - rank;
    // With hardly more rows than functions no statement is possible.
    if (rank == 0 || rest <= problem_.options().lack_of_fit.free_rows * rank) return 1.0;
    VectorXd null(draws);
    for (Index s = 0; s < null.size(); ++s) null[s] = statistic(of_noise_.col(s));
    const double mean = null.mean(),
                 variance = (null.array() - mean).square().sum() / static_cast<double>(null.size() - 1);
    const double freedom = std::clamp(2 * mean * mean / std::max(variance, 1e-300), 1.0, rank);
    Expected expected{odds(mean, mean_noise_), freedom, rest};
    if (before_.rows > 0) expect_healthy(family, rank, rest, expected);
    if (seen_.rows > 0) expect_encoder(family, odds(mean, mean_noise_), rest, expected);
    return chance(odds(statistic(today_.residual), today_.whole) / std::max(expected.share, 1e-300), expected.freedom,
                  expected.known_by);
  }
  /// What the healthy session has of it beyond noise (friction near standstill, where the velocity is uncertain, or a
  /// background that another motion shows otherwise) is no change: the same share, however many rows there are.
  void expect_healthy(const Family& family, double rank, double rest, Expected& expected) const {
    const Projection then(before_.gram, before_.size, family);
    const auto also = static_cast<double>(then.rank());
    const double beyond =
        std::max(0.0, odds(then(before_.residual), before_.whole) - also / std::max(before_.rows - also, 1.0));
    expected.share = std::max(expected.share, rank / rest + beyond);
    // A background is known as well as so many of its functions determine it, not rows.
    if (problem_.background(joint_) != nullptr)
      expected.known_by = expected.share * expected.share /
                          (expected.share * expected.share / rest + beyond * beyond / expected.freedom);
  }
  /// What a robot without anything missing has of it, seen through the same encoders: one draw, and known by one, of as
  /// many free numbers as its directions count, (sum c^2)^2 / sum c^4.
  void expect_encoder(const Family& family, double of_noise, double rest, Expected& expected) const {
    const Projection seen(seen_.gram, seen_.size, family);
    const auto rank = static_cast<double>(seen.rank());
    const Eigen::ArrayXd square = seen.coordinates(seen_.residual).array().square();
    // Its noise is not today's.
    const double made = (square.sum() - rank) * w_ / w_seen_ / today_.whole;
    if (!(of_noise + made > expected.share)) return;
    const double directions = std::max(square.sum() * square.sum() / std::max(square.square().sum(), 1e-300), 1.0);
    const double share = of_noise + made;
    const auto free = [&](double noise) {
      return share * share / (of_noise * of_noise / noise + made * made / directions);
    };
    expected = {share, free(expected.freedom), free(rest)};
  }

  const Linearised& problem_;
  std::size_t joint_;
  const LinearFit& fit_;
  double w_, w_seen_ = 1, rows_of_fit_, mean_noise_ = 0, fitted_ = 0;
  Products today_, before_{}, seen_{};
  MatrixXd of_noise_;
};

}  // namespace

LackOfFit lack_of_fit(const Linearised& problem, std::size_t joint, const LinearFit& fit, const LinearFit* alone,
                      const MatrixXd& all_features) {
  LackOfFit out;
  const auto k = static_cast<Index>(joint);
  const VectorXd residual = problem.solver().residual(joint, fit);
  if (fit.square[k] * problem.solver().weights()[k] < no_variance_left * fit.rows[k]) return out;
  StateTest test(problem, joint, fit, alone, all_features, residual);
  out.state_p = test.smallest_chance();
  const LackOfFitOptions& options = problem.options().lack_of_fit;
  if (out.state_p < std::max({options.state, options.suspected, options.curve}) && test.expect_encoder_errors())
    out.state_p = test.smallest_chance();
  out.time_p = in_time(problem, joint, residual, problem.blocks().fit, residual).p;
  if (out.state_p < options.state) out.elsewhere_p = test.smallest_chance_elsewhere();
  return out;
}

double structured_share(const Linearised& problem, std::size_t joint, const LinearFit& fit,
                        const MatrixXd& all_features, const std::vector<std::size_t>& blocks, bool healthy) {
  const VectorXd residual = problem.solver().residual(joint, fit), e = only(problem, residual, blocks, healthy);
  const MatrixXd f = only(problem, joint, all_features, blocks, healthy);
  Index count = 0;
  for (const std::size_t b : blocks)
    count += problem.blocks().all[b].healthy == healthy ? problem.blocks().all[b].count : 0;
  if (!(e.squaredNorm() > 0)) return 0;
  const VectorXd size = f.colwise().norm().transpose().array().max(1e-300).inverse();
  const MatrixXd gram = f.transpose() * f, noise = stand_ins(problem, joint, residual, residual, blocks),
                 theirs = f.transpose() * noise;
  const VectorXd mine = f.transpose() * e;
  const double whole = e.squaredNorm();
  // found = structure + expected * (whole - structure)
  const auto share_of = [&](const Projection& energy) {
    if (2 * count < 3 * energy.rank()) return 0.0;  // too few rows
    double null = 0;
    for (Index s = 0; s < theirs.cols(); ++s) null += energy(theirs.col(s));
    const double found = energy(mine), expected = std::min(null / std::max(noise.squaredNorm(), 1e-300), most_expected);
    return std::clamp((found / whole - expected) / (1 - expected), 0.0, 1.0);
  };
  const Projection all(gram, size, {0, f.cols()});
  double of_state = share_of(all);
  for (const Family& family : families(problem.joints()))
    of_state = std::max(of_state, share_of(Projection(gram, size, family)));
  if (healthy) return of_state;
  // What the state does not explain may still repeat or wander.
  const VectorXd rest = 2 * count < 3 * all.rank() ? e : e - f * all.coefficients(all.coordinates(mine));
  const double of_time = in_time(problem, joint, rest, blocks, rest + (residual - e)).share;
  return of_state + (1 - of_state) * std::clamp(of_time, 0.0, 1.0);
}

}  // namespace fxdyn::diagnosis
