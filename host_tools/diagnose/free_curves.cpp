#include "host_tools/diagnose/free_curves.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "host_tools/diagnose/bumps.hpp"
#include "host_tools/diagnose/curve_sentence.hpp"
#include "host_tools/diagnose/curve_squares.hpp"
#include "host_tools/diagnose/curveless.hpp"
#include "host_tools/diagnose/deviations.hpp"
#include "host_tools/diagnose/dictionary.hpp"
#include "host_tools/diagnose/gate.hpp"
#include "host_tools/diagnose/refit.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/support/parallel.hpp"
#include "model/effects/curve.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Parts of the motion over which the knots may be for every variable: the whole and halves.
constexpr int coarsest_parts = 2;
/// Where a curve is drawn: four points a piece.
constexpr Index drawn_points = 4 * static_cast<Index>(curve_pieces) + 1;

std::vector<VectorXd> white(std::size_t joints) { return std::vector<VectorXd>(joints, VectorXd::Zero(1)); }

/// The joint that a curve's variable is of.
std::size_t joint_of_variable(const EffectCandidate& effect) {
  return find_effect(effect.effect)->needs_peers ? static_cast<std::size_t>(effect.shape[0]) - 1 : effect.joint;
}

/// A variable is an effect's, of a joint.
bool same_variable(const EffectCandidate& a, const EffectCandidate& b) {
  return a.effect == b.effect && joint_of_variable(a) == joint_of_variable(b);
}

/// What a curve leaves on what judges.
struct Tried {
  EffectCandidate effect;
  double left = 1e300;
};

/// By log and row: 1 where the joint moves by more than the velocity's noise (Models::least_width), else 0. At rest
/// stiction holds any torque: what is there chooses no curve.
std::vector<VectorXd> moves(const Linearised& problem, std::size_t joint) {
  const std::vector<double>& widths = problem.models().least_width;
  const double least = widths.empty() ? 0 : widths[joint];
  std::vector<VectorXd> out;
  for (std::size_t l = 0; l < problem.logs().size(); ++l) {
    const auto speed = problem.motion(l).dq.col(static_cast<Index>(joint)).array().abs();
    out.emplace_back((speed > least).cast<double>());
  }
  return out;
}

/// Where the joint moves.
MatrixXd columns_of(const Linearised& problem, const EffectCandidate& curve, const std::vector<VectorXd>& moving) {
  Group group;
  group.candidate = curve;
  return problem.make(group, false, moving)[curve.joint];
}

/// Curves of one joint.
class Trials {
 public:
  Trials(const Linearised& problem, std::size_t joint, const std::vector<Index>& columns, double prior,
         const std::vector<Fold>& folds)
      : problem_(problem),
        joint_(joint),
        columns_(columns),
        prior_(prior),
        folds_(folds),
        moving_(moves(problem, joint)) {
    for (std::size_t j = 0; j < problem.joints(); ++j) scales_.push_back(scales_of(problem, j));
  }

  /// The best curve of each variable, the best first. Fine parts are tried of the two best variables only.
  std::vector<Tried> best_of_each() {
    std::vector<EffectCandidate> coarse;
    for (const EffectInfo& info : effect_infos()) {
      if (!info.curve) continue;
      for (std::size_t of = 0; of < scales_.size(); ++of) {
        if ((of != joint_) != info.needs_peers) continue;
        for (int parts = 1; parts <= coarsest_parts; parts *= 2) add(info, of, parts, coarse);
      }
    }
    std::vector<Tried> out = best(coarse);
    std::vector<EffectCandidate> fine;
    for (std::size_t i = 0; i < std::min<std::size_t>(2, out.size()); ++i) {
      for (int parts = 2 * coarsest_parts; parts <= finest_parts; parts *= 2)
        add(*find_effect(out[i].effect.effect), joint_of_variable(out[i].effect), parts, fine);
    }
    for (const Tried& one : best(fine)) {
      const auto same = std::find_if(out.begin(), out.end(),
                                     [&](const Tried& other) { return same_variable(other.effect, one.effect); });
      if (one.left < same->left) *same = one;
    }
    std::sort(out.begin(), out.end(), less);
    return out;
  }
  std::size_t count() const { return count_; }
  const std::vector<VectorXd>& moving() const { return moving_; }

 private:
  static bool less(const Tried& a, const Tried& b) { return a.left < b.left; }
  /// Knots over each of so many parts of the motion, and over those between. @param of the variable's joint
  void add(const EffectInfo& info, std::size_t of, int parts, std::vector<EffectCandidate>& to) const {
    for (EffectCandidate& curve : curves_over_parts(info, joint_, of, scales_[of], parts))
      to.push_back(std::move(curve));
  }
  std::vector<Tried> best(const std::vector<EffectCandidate>& all) {
    std::vector<double> left(all.size());
    parallel_for(all.size(), [&](std::size_t i) {
      const MatrixXd curve = columns_of(problem_, all[i], moving_);
      for (const Fold& fold : folds_) left[i] += judged_with_curves(problem_, joint_, columns_, curve, prior_, fold);
    });
    count_ += all.size();
    std::vector<Tried> out;
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (out.empty() || !same_variable(out.back().effect, all[i])) out.push_back({all[i]});
      if (left[i] < out.back().left) out.back() = {all[i], left[i]};
    }
    std::sort(out.begin(), out.end(), less);
    return out;
  }

  const Linearised& problem_;
  std::size_t joint_;
  const std::vector<Index>& columns_;
  double prior_;
  const std::vector<Fold>& folds_;
  std::vector<VectorXd> moving_;
  std::vector<MotionScales> scales_;  ///< by joint
  std::size_t count_ = 0;
};

/// "cross_position of joint 4"
std::string words_of_variable(const EffectCandidate& effect) {
  const std::size_t of = joint_of_variable(effect);
  return of == effect.joint ? effect.effect : fmt::format("{} of joint {}", effect.effect, of + 1);
}

/// The curve that explains most at a joint, where it is sure and worth its numbers.
/// @param size prior deviation of its heights @param tried_before curves, of all folds; their number grows
std::optional<FreeCurve> best_by(const Linearised& problem, std::size_t joint, double size,
                                 const std::vector<Fold>& folds, std::size_t& tried_before) {
  const Options& options = problem.options();
  const std::vector<Index> columns = problem.columns_of(in_model(problem));
  const auto j = static_cast<Index>(joint);
  const double dilution = problem.solver().weights()[j] / diluted_weights(problem)[j];
  double before = 0, rows = 0;
  for (const Fold& fold : folds) {
    before += judged_with_curves(problem, joint, columns, MatrixXd(problem.solver().rows(joint).x.rows(), 0), 0, fold);
    rows += problem.solver().row_count(fold.judge)[j] / dilution;
  }
  const double prior = 1 / (size * size);
  Trials trials(problem, joint, columns, prior, folds);
  const std::vector<Tried> tried = trials.best_of_each();
  tried_before += trials.count();
  if (tried.empty()) return {};
  const LeftBy other = left_without_curve(problem, joint, columns, prior, folds, trials.moving());
  const auto odds = [&](double without, double with) {
    return rows * std::log(without / std::max(with, 1e-300)) / variances_per_decade;
  };
  if (odds(tried[0].left, other.left) >= options.gate.established) return {};
  FreeCurve out;
  out.effect = tried[0].effect;
  out.closes = 1 - tried[0].left / before;
  out.odds_nothing = odds(before, tried[0].left) - std::log10(static_cast<double>(tried_before));
  const bool by_curve = tried.size() > 1 && tried[1].left <= other.left;
  if (by_curve || other.left < before) {
    out.odds_rival = odds(by_curve ? tried[1].left : other.left, tried[0].left);
    out.rival = by_curve ? words_of_variable(tried[1].effect) : other.variable;
  }
  if (out.odds_nothing < options.gate.established || out.closes < options.curve.least_share) return {};
  return out;
}

/// Whether one log alone has what a curve closes: all others together have less of it than is worth a curve.
bool is_of_one_log(const Linearised& problem, const FreeCurve& curve, double size, const std::vector<Fold>& folds) {
  const std::vector<Index> columns = problem.columns_of(in_model(problem));
  const MatrixXd with = columns_of(problem, curve.effect, moves(problem, curve.effect.joint)), without(with.rows(), 0);
  std::map<std::size_t, double> closed;  // by log
  for (const Fold& fold : folds) {
    for (const std::size_t judge : fold.judge) {
      const Fold of{fold.fit, {judge}};
      const auto left = [&](const MatrixXd& columns_of_curve) {
        return judged_with_curves(problem, curve.effect.joint, columns, columns_of_curve, 1 / (size * size), of);
      };
      closed[problem.blocks().all[judge].log] += left(without) - left(with);
    }
  }
  double sum = 0, most = 0;
  for (const auto& [log, square] : closed) {
    sum += std::max(square, 0.0);
    most = std::max(most, square);
  }
  return sum - most < problem.options().curve.least_share * sum;
}

std::optional<FreeCurve> best_at(const Linearised& problem, std::size_t joint, double size) {
  const Blocks& blocks = problem.blocks();
  std::size_t tried = 0;
  if (auto out = best_by(problem, joint, size, blocks.folds, tried)) return out;
  if (blocks.whole_logs.empty() || blocks.folds.front().judge != blocks.whole_logs.front().judge) return {};
  // No log can be predicted by others that lack what it shows, as a stop that it alone runs into: parts of it judge.
  const std::vector<Fold> parts = make_blocks(problem.logs()).folds;
  auto out = best_by(problem, joint, size, parts, tried);
  return out && is_of_one_log(problem, *out, size, parts) ? out : std::nullopt;
}

/// Appends a curve of height 0.
EffectId put(Models& models, const EffectCandidate& effect) {
  Group group;
  group.candidate = effect;
  return name(models, group, VectorXd::Zero(static_cast<Index>(curve_heights)));
}

bool is_flat(const Models& models, const FreeCurve& curve) {
  const std::vector<double>& heights = joints_of(models.current)[curve.id.joint].effects[curve.id.effect].linear;
  return std::all_of(heights.begin(), heights.end(), [](double h) { return h == 0 || !std::isfinite(h); });
}

/// Where a curve's knots are: its shape ends with that.
Knots knots_of(const EffectCandidate& curve) { return {curve.shape[curve.shape.size() - 2], curve.shape.back()}; }

/// What a curve's variable is, as in GapRegion.
std::string variable_of(const EffectInfo& info) {
  switch (info.shape[info.shape.size() - 2].quantity) {
    case Quantity::velocity:
      return "dq";
    case Quantity::torque:
      return "load";
    default:
      return "q";
  }
}
VectorXd values_of(const std::string& variable, const Linearised& problem, std::size_t log, std::size_t joint) {
  const auto j = static_cast<Index>(joint);
  if (variable == "dq") return problem.motion(log).dq.col(j);
  if (variable == "load") return problem.robot_columns(log).structural().col(j);
  return problem.motion(log).q.col(j);
}

/// What nominal effects have of a variable: an offset, or dry friction that is the same everywhere; of the velocity
/// viscous and dry friction too, of the load a gain. Values x functions.
MatrixXd nominal_functions(const std::string& variable, const VectorXd& values, double sign_width) {
  MatrixXd out = MatrixXd::Ones(values.size(), variable == "q" ? 1 : variable == "dq" ? 3 : 2);
  if (out.cols() > 1) out.col(1) = values;
  if (out.cols() > 2) out.col(2) = (values.array() / sign_width).tanh();
  return out;
}

/// Coefficients of the nominal functions in each height's factor, by least squares over the logs that fit.
MatrixXd nominal_part(const Linearised& problem, const FreeCurve& curve, const std::string& variable, double width) {
  const auto heights = static_cast<Index>(curve_heights);
  MatrixXd gram, cross;
  for (std::size_t l = 0; l < problem.logs().size(); ++l) {
    const SessionLog& entry = problem.logs()[l];
    if (entry.healthy || !entry.fits) continue;
    const VectorXd values = values_of(variable, problem, l, joint_of_variable(curve.effect))
                                .segment(entry.log.first, entry.log.last - entry.log.first);
    const MatrixXd nominal = nominal_functions(variable, values, width);
    if (gram.size() == 0) {
      gram = MatrixXd::Zero(nominal.cols(), nominal.cols());
      cross = MatrixXd::Zero(nominal.cols(), heights);
    }
    gram += nominal.transpose() * nominal;
    cross += nominal.transpose() * bumps(knots_of(curve.effect), values);
  }
  return SymmetricSolver(gram).inverse() * cross;
}

/// Variance of what a curve of twelve heights can't follow: that of the residual's means over the variable's classes,
/// less what noise makes of them.
/// @param residual of the joint, all rows
double misfit(const Linearised& problem, const FreeCurve& curve, const CurveResult& of, const VectorXd& residual) {
  const Knots knots = knots_of(curve.effect);
  VectorXd sum = VectorXd::Zero(drawn_points), count = VectorXd::Zero(drawn_points);
  double square = 0;
  for (std::size_t l = 0; l < problem.logs().size(); ++l) {
    const SessionLog& entry = problem.logs()[l];
    if (entry.healthy || !entry.fits) continue;
    const Block& block = problem.blocks().of_log[l];
    const VectorXd x = entry.log.decimate(values_of(of.signal, problem, l, joint_of_variable(curve.effect)));
    const VectorXd dq = entry.log.decimate(values_of("dq", problem, l, curve.effect.joint));
    for (Index row = 0; row < block.count; ++row) {
      const double place = knots.place(x[row]);
      if (place < 0 || place > 1) continue;
      const double e = residual[block.first + row] * (of.friction && dq[row] < 0 ? -1 : 1);
      const auto bin = static_cast<Index>(std::lround(place * static_cast<double>(drawn_points - 1)));
      sum[bin] += e;
      count[bin] += 1;
      square += e * e;
    }
  }
  double of_means = 0;
  Index bins = 0;
  for (Index bin = 0; bin < drawn_points; ++bin) {
    if (count[bin] == 0) continue;
    of_means += sum[bin] * sum[bin] / count[bin];
    ++bins;
  }
  const double rows = count.sum();
  if (rows <= static_cast<double>(bins)) return 0;
  const double noise = (square - of_means) / (rows - static_cast<double>(bins));
  return std::max(0.0, (of_means - static_cast<double>(bins) * noise) / rows);
}

/// Whether a curve of the load takes or gives more than all of the load: a drive loses no more than goes through it.
bool exceeds_load(const Models& models, const FreeCurve& curve) {
  if (variable_of(*find_effect(curve.effect.effect)) != "load") return false;
  const Knots knots = knots_of(curve.effect);
  const VectorXd at = VectorXd::LinSpaced(drawn_points, knots.from, knots.from + knots.span);
  const std::vector<double>& linear = joints_of(models.current)[curve.id.joint].effects[curve.id.effect].linear;
  const VectorXd y = bumps(knots, at) * Eigen::Map<const VectorXd>(linear.data(), static_cast<Index>(curve_heights));
  const Index steps = drawn_points - 1;
  return ((y.tail(steps) - y.head(steps)).array().abs() > (at.tail(steps) - at.head(steps)).array()).any();
}

bool is_any(const std::vector<bool>& of) { return std::find(of.begin(), of.end(), true) != of.end(); }

std::vector<bool> harmed_by(const Models& now, const Models& before, const std::vector<SessionLog>& logs) {
  return harmed_joints(now.options.gate, before.current, now.current, logs);
}

std::vector<bool> joints_with(const std::vector<FreeCurve>& curves, std::size_t joints) {
  std::vector<bool> out(joints, false);
  for (const FreeCurve& curve : curves) out[curve.effect.joint] = true;
  return out;
}

}  // namespace

std::vector<FreeCurve> add_free_curves(Models& models, const std::vector<SessionLog>& logs,
                                       const std::vector<bool>& without) {
  const std::size_t n = joints_of(models.current).size();
  std::vector<FreeCurve> found;
  const Models before = models;
  if (std::find(without.begin(), without.end(), false) == without.end()) return found;
  {
    const Linearised problem(models, logs, white(n));
    models.curve_size.assign(n, 0);
    for (std::size_t j = 0; j < n; ++j) {
      if (without[j]) continue;
      models.curve_size[j] = models.options.curve.height / std::sqrt(problem.solver().weights()[static_cast<Index>(j)]);
      if (auto curve = best_at(problem, j, models.curve_size[j])) found.push_back(*curve);
    }
  }
  const std::vector<double> size = models.curve_size;
  const auto fit = [&](const std::vector<bool>& only) {
    models = before;
    models.curve_size = size;
    for (FreeCurve& curve : found) curve.id = put(models, curve.effect);
    refit(models, logs, white(n), 4, only);
  };
  // A fit that took no step leaves heights of 0: then there is nothing to draw.
  const auto drop_impossible = [&] {
    return std::erase_if(found, [&](const FreeCurve& curve) {
             return is_flat(models, curve) || exceeds_load(models, curve);
           }) > 0;
  };
  while (!found.empty()) {
    fit({});
    if (drop_impossible()) continue;
    std::vector<bool> harmed = harmed_by(models, before, logs);
    if (is_any(harmed)) {
      // What a curve does not explain goes to the base parameters, which its joint has in common with others.
      fit(joints_with(found, n));
      if (drop_impossible()) continue;
      harmed = harmed_by(models, before, logs);
    }
    if (!is_any(harmed)) return found;
    const auto its = [&](const FreeCurve& curve) { return harmed[curve.effect.joint]; };
    // Harm at joints without a curve comes from one of the others: the least sure goes.
    if (std::erase_if(found, its) == 0) {
      found.erase(std::min_element(found.begin(), found.end(), [](const FreeCurve& a, const FreeCurve& b) {
        return a.odds_nothing < b.odds_nothing;
      }));
    }
  }
  models = before;
  return found;
}

CurveResult drawn(const Models& models, const FreeCurve& curve, const std::vector<SessionLog>& logs) {
  const EffectInfo& info = *find_effect(curve.effect.effect);
  const std::size_t of_joint = joint_of_variable(curve.effect);
  const Joint& of = robot_of(models.current).joints[of_joint];
  Linearised problem(models, logs, white(joints_of(models.current).size()));
  problem.solver().set_weights(diluted_weights(problem));
  const LinearFit fit = problem.solver().solve(problem.unknown_columns());
  const MatrixXd covariance = SymmetricSolver(fit.information).inverse();
  const auto heights = static_cast<Index>(curve_heights);
  Index first = -1;
  for (const Group& group : problem.groups()) {
    if (group.in_model && group.id == curve.id) first = group.first;
  }
  CurveResult out;
  out.effect = curve.effect.effect;
  out.signal = variable_of(info);
  const ParameterInfo& from = info.shape[0];
  const bool turns = of.type == JointType::revolute;
  out.unit = info.needs_peers ? of.position_unit() : std::string(turns ? from.unit : from.unit_prismatic);
  if (of_joint != curve.effect.joint) out.joint = of_joint + 1;
  out.friction = info.friction && out.signal == "q";
  out.odds_nothing = curve.odds_nothing;
  out.odds_rival = curve.odds_rival;
  out.rival = curve.rival;
  out.closes = curve.closes;
  const Knots knots = knots_of(curve.effect);
  const VectorXd x = VectorXd::LinSpaced(drawn_points, knots.from, knots.from + knots.span);
  const double width = joints_of(models.current)[curve.effect.joint].sign_width;
  const MatrixXd factors =
      bumps(knots, x) - nominal_functions(out.signal, x, width) * nominal_part(problem, curve, out.signal, width);
  const std::vector<double>& linear = joints_of(models.current)[curve.effect.joint].effects[curve.id.effect].linear;
  const VectorXd y = factors * Eigen::Map<const VectorXd>(linear.data(), heights);
  const MatrixXd spread = factors * covariance.block(first, first, heights, heights) * factors.transpose();
  const double more = misfit(problem, curve, out, problem.solver().residual(curve.effect.joint, fit));
  for (Index i = 0; i < drawn_points; ++i)
    out.points.push_back({x[i], y[i], std::sqrt(std::max(spread(i, i), 0.0) + more)});
  tell(out, robot_of(models.current), curve.effect.joint, logs);
  return out;
}

}  // namespace fxdyn::diagnosis
