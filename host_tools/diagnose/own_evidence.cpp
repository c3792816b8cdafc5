#include "host_tools/diagnose/own_evidence.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <mutex>
#include <optional>

#include "host_tools/diagnose/curve_squares.hpp"
#include "host_tools/diagnose/dictionary.hpp"
#include "host_tools/diagnose/features.hpp"
#include "host_tools/diagnose/without.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/joint_fit.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Functions of one joint in families, on today's rows in which it moves for sure.
class Curves {
 public:
  Curves(const Linearised& problem, std::size_t joint, const MatrixXd& features)
      : joints_(problem.joints()), families_(families(problem.joints())) {
    // The own position's are finer here: a curve has to follow what several effects in a row would.
    const MatrixXd fine = position_waves(problem, joint, fine_waves);
    families_[place_of_own_position(problem.joints())] = {features.cols(), fine.cols()};
    // Laws of friction resemble a torque with the jerk, of which there is no effect.
    Family& motion = families_[place_of_own_motion(problem.joints())];
    const MatrixXd of_motion = features.middleCols(motion.first, motion.count);
    motion = {features.cols() + fine.cols(), motion.count + 1};
    all_.resize(features.rows(), motion.first + motion.count);
    all_ << features, fine, of_motion, jerk(problem, joint);
    for (Index row = 0; row < all_.rows(); ++row) {
      if (problem.noise().is_doubtful(joint, row)) all_.row(row).setZero();
    }
    for (const Block& block : problem.blocks().all) {
      if (block.healthy) all_.middleRows(block.first, block.count).setZero();
    }
    all_ = of_size_one(all_);
    if (const Background* background = problem.background(joint)) all_ = background->eliminate(all_);
  }

  std::size_t count() const { return families_.size(); }
  std::size_t own_position() const { return place_of_own_position(joints_); }
  /// Columns of some families side by side: rows, below them those that the joint's background adds.
  MatrixXd of(const std::vector<std::size_t>& chosen) const {
    Index cols = 0;
    for (const std::size_t f : chosen) cols += families_[f].count;
    MatrixXd out(all_.rows(), cols);
    cols = 0;
    for (const std::size_t f : chosen) {
      out.middleCols(cols, families_[f].count) = all_.middleCols(families_[f].first, families_[f].count);
      cols += families_[f].count;
    }
    return out;
  }
  /// Of size one each, as their prior is.
  static MatrixXd of_size_one(const MatrixXd& columns) {
    const VectorXd size = (columns.colwise().norm() / std::sqrt(static_cast<double>(columns.rows()))).transpose();
    return columns * size.unaryExpr([](double s) { return s > 1e-9 ? 1 / s : 0.0; }).asDiagonal();
  }
  /// The family of an effect's own variable.
  std::size_t of_variable(const EffectCandidate& effect) const {
    const EffectInfo& info = *find_effect(effect.effect);
    const std::size_t position = place_of_own_position(joints_);
    if (info.needs_peers) return joints_ > 1 ? position - 1 : 0;
    if (drifts(effect.effect)) return count() - 1;
    return turns_with_position(effect, info) ? position : place_of_own_motion(joints_);
  }

 private:
  static constexpr Index fine_waves = 24;
  /// Whether its torque at rest is another in another position.
  static bool turns_with_position(const EffectCandidate& effect, const EffectInfo& info) {
    if (info.acts_on != ActsOn::torque || info.needs_structural || info.needs_total) return false;
    const VectorXd zero = VectorXd::Zero(16);
    const JointSeries series{VectorXd::LinSpaced(16, -1, 1), zero, zero, {}, 1e-3};
    const MatrixXd phi = effect_columns(effect.effect, effect.shape, 1, series);
    return (phi.rowwise() - phi.row(0)).cwiseAbs().maxCoeff() > 1e-9;
  }

  std::size_t joints_;
  std::vector<Family> families_;
  MatrixXd all_;
};

/// One joint's groups.
class AtJoint {
 public:
  AtJoint(const Linearised& problem, std::size_t joint, const std::vector<std::size_t>& groups,
          const std::vector<std::size_t>& own, const MatrixXd& features)
      : problem_(problem),
        joint_(joint),
        weight_(problem.solver().weights()[static_cast<Index>(joint)]),
        groups_(groups),
        curves_(problem, joint, features) {
    for (const Fold& fold : problem.blocks().folds)
      rows_ += problem.solver().row_count(fold.judge)[static_cast<Index>(joint)];
    for (const std::size_t g : own) variable_.push_back(curves_.of_variable(problem.groups()[g].candidate));
    rows_ = std::max(rows_, 1.0);
    const Deviance size = judged(without(own));
    for (std::size_t i = 0; i < own.size(); ++i) evidence_.push_back(of(own, i, size));
  }
  const std::vector<OwnEvidence>& evidence() const { return evidence_; }

 private:
  // A curve's sizes that are tried, each with so many times the precision of the one before; hand: from what is there
  // down to a hundredth of it.
  static constexpr double finer = 10;
  static constexpr int sizes = 5;

  std::vector<std::size_t> without(const std::vector<std::size_t>& gone) const {
    std::vector<std::size_t> left;
    for (const std::size_t g : groups_) {
      if (std::find(gone.begin(), gone.end(), g) == gone.end()) left.push_back(g);
    }
    return left;
  }
  /// Around a model without some groups, where one of them works on what others do; else null.
  const Linearised* relinearised(const std::vector<std::size_t>& gone) const {
    const auto works = [&](std::size_t g) { return works_on_others(problem_.groups()[g]); };
    if (std::none_of(gone.begin(), gone.end(), works)) return nullptr;
    static std::mutex one_at_a_time;  // what problems of the same logs share is made once
    std::unique_ptr<Linearised>& around = around_[gone];
    if (around) return around.get();
    const std::lock_guard lock(one_at_a_time);
    around = diagnosis::without(problem_, gone);
    return around.get();
  }
  Deviance judged(const std::vector<std::size_t>& groups) const {
    return judged(groups, std::vector<std::size_t>{}, {});
  }
  /// The deviance of all folds, with curves of the size that suits them best.
  /// @param nothing the deviance without them: they are at most as large as what is there
  Deviance judged(const std::vector<std::size_t>& groups, const std::vector<std::size_t>& families,
                  const Deviance& nothing) const {
    return judged(groups, curves_.of(families), nothing);
  }
  Deviance judged(const std::vector<std::size_t>& groups, const MatrixXd& curves, const Deviance& nothing) const {
    std::vector<PredictiveDeviance> folds;
    const Linearised* around = relinearised(without(groups));
    const Linearised& problem = around != nullptr ? *around : problem_;
    const std::vector<Index> columns =
        around != nullptr ? around->columns_of(in_model(*around)) : problem_.columns_of(groups);
    for (const Fold& fold : problem_.blocks().folds) folds.emplace_back(problem, joint_, columns, curves, fold);
    double precision = weight_ / std::max(1.0, nothing.square / rows_);
    Deviance best;
    for (int i = 0; i < (curves.cols() == 0 ? 1 : sizes); ++i, precision *= finer) {
      Deviance sum;
      for (const PredictiveDeviance& fold : folds) {
        const Deviance of = fold(precision);
        sum.square += of.square;
        sum.log_determinant += of.log_determinant;
      }
      if (i == 0 || less(sum, best)) best = sum;
    }
    return best;
  }
  bool less(const Deviance& a, const Deviance& b) const { return gain(a, b) < 0; }
  double gain(const Deviance& without, const Deviance& with) const {
    return without.of_any_noise(rows_) - with.of_any_noise(rows_);
  }
  OwnEvidence of(const std::vector<std::size_t>& own, std::size_t i, const Deviance& size) const {
    OwnEvidence out;
    std::vector<std::size_t> others, alike;
    // Those of time, the last, say nothing of other times.
    for (std::size_t f = 0; f + 1 < curves_.count(); ++f) {
      if (f != variable_[i]) others.push_back(f);
    }
    for (std::size_t k = 0; k < own.size(); ++k) {
      if (variable_[k] == variable_[i]) alike.push_back(own[k]);
    }
    out.gain = gain(judged(without({own[i]}), others, size), judged(groups_, others, size));
    const std::vector<std::size_t> rest = without(alike);
    const Deviance nothing = judged(rest), named = judged(groups_);
    const Deviance curve = std::min(judged(rest, {variable_[i]}, nothing), judged(groups_, {variable_[i]}, nothing),
                                    [&](const Deviance& a, const Deviance& b) { return less(a, b); });
    out.alike = alike.size();
    out.of_time = variable_[i] + 1 == curves_.count();
    out.of_position = variable_[i] == curves_.own_position();
    const double by_names = nothing.sum() - named.sum(), by_curve = nothing.sum() - curve.sum();
    out.form = by_curve > 0 ? std::max(0.0, by_names) / by_curve : 1.0;
    out.curve_gain = gain(named, curve) - 2 * std::log(2 * sizes);
    if (out.of_position && out.alike > 1) {
      if (!spline_gain_) spline_gain_ = spline_gain(rest, nothing, named);
      out.spline_gain = *spline_gain_;
    }
    return out;
  }
  /// Of the best free curve of the position in the place of names, with knots over the whole range or parts of it.
  /// @param rest groups without the names @param nothing, named deviances without and with them
  double spline_gain(const std::vector<std::size_t>& rest, const Deviance& nothing, const Deviance& named) const {
    const EffectInfo& info = *find_effect("position_curve");
    const MotionScales scales = scales_of(problem_, joint_);
    Deviance best = nothing;
    std::size_t tried = 0;
    for (int parts = 1; parts <= finest_parts; parts *= 2) {
      for (const EffectCandidate& curve : curves_over_parts(info, joint_, joint_, scales, parts)) {
        Group group;
        group.candidate = curve;
        const Deviance of = judged(rest, Curves::of_size_one(problem_.make(group)[joint_]), nothing);
        if (less(of, best)) best = of;
        ++tried;
      }
    }
    if (tried == 0) return 0;  // hardly any motion has room for knots
    return gain(named, best) - 2 * std::log(static_cast<double>(sizes * tried));
  }

  const Linearised& problem_;
  std::size_t joint_;
  double weight_;
  const std::vector<std::size_t>& groups_;
  Curves curves_;
  double rows_ = 0;
  std::vector<std::size_t> variable_;  ///< by own group: a family
  std::vector<OwnEvidence> evidence_;
  mutable std::optional<double> spline_gain_;  ///< the same of all names of the position
  mutable std::map<std::vector<std::size_t>, std::unique_ptr<Linearised>> around_;  ///< by what is left out
};

/// -2 ln likelihood of what judges, but for a constant: of each joint rows times ln of the squares.
VectorXd judged_robot(const Linearised& problem, const std::vector<std::size_t>& groups) {
  const BlockSolver& solver = problem.solver();
  VectorXd squares = VectorXd::Zero(static_cast<Index>(problem.joints())), rows = squares;
  for (const Fold& fold : problem.blocks().folds) {
    squares += solver.square(solver.solve(problem.columns_of(groups), fold.fit), fold.judge);
    rows += solver.row_count(fold.judge);
  }
  return rows.array() * squares.array().max(1e-300).log();
}

}  // namespace

double form_on_robot(Linearised& problem, const std::vector<std::size_t>& groups, std::size_t effect) {
  const Group group = problem.groups()[effect];
  std::vector<std::size_t> others = groups;
  std::erase(others, effect);
  std::vector<std::size_t> freed = others;
  for (std::size_t j = 0; j < problem.joints(); ++j) {
    const JointRows& rows = problem.solver().rows(j);
    const Index place = rows.place(group.first);
    if (place < 0) continue;
    std::vector<MatrixXd> of_joint(problem.joints());
    of_joint[j].resize(rows.x.rows() + rows.extra_x.rows(), group.count);
    of_joint[j].topRows(rows.x.rows()) = rows.x.middleCols(place, group.count);
    if (rows.extra_x.rows() > 0)
      of_joint[j].bottomRows(rows.extra_x.rows()) = rows.extra_x.middleCols(place, group.count);
    Group one = group;
    one.in_model = false;
    freed.push_back(problem.add(one, of_joint));
  }
  const VectorXd nothing = judged_robot(problem, others), common = judged_robot(problem, groups),
                 own = judged_robot(problem, freed);
  Index most = 0;
  const double strongest = (nothing - common).maxCoeff(&most);
  const double elsewhere = (nothing - common).sum() - strongest,
               own_elsewhere = (nothing - own).sum() - (nothing - own)[most];
  if (elsewhere < problem.options().gate.sure_gain) return 0;
  return own_elsewhere > 0 ? elsewhere / own_elsewhere : 1.0;
}

std::vector<OwnEvidence> own_evidence(const Linearised& problem, const std::vector<std::size_t>& groups,
                                      const std::vector<MatrixXd>& features) {
  std::vector<OwnEvidence> out(groups.size());
  parallel_for(problem.joints(), [&](std::size_t j) {
    std::vector<std::size_t> own, place;
    for (std::size_t i = 0; i < groups.size(); ++i) {
      const Group& group = problem.groups()[groups[i]];
      if (group.on_body || group.candidate.joint != j) continue;
      own.push_back(groups[i]);
      place.push_back(i);
    }
    if (own.empty()) return;
    const AtJoint at(problem, j, groups, own, features[j]);
    for (std::size_t k = 0; k < own.size(); ++k) out[place[k]] = at.evidence()[k];
  });
  return out;
}

}  // namespace fxdyn::diagnosis
