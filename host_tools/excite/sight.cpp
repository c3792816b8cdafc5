#include "host_tools/excite/sight.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/excite/effect_information.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// rho^2 below which nothing is left of a direction.
constexpr double nothing_left = 1e-5;
constexpr double confused_from = 0.95;
/// Smallest effect that still counts as seen, share of rated torque.
constexpr double seen_below = 0.005;
/// Directions of an effect's columns, each of unit information before the nominal model takes its part, and what that
/// leaves of each (rho^2).
struct Directions {
  MatrixXd u;       ///< columns x directions
  VectorXd square;  ///< rho^2
};

/// @param before, after: information on the effect's columns before and after the nominal model takes its part
Directions directions(const MatrixXd& before, const MatrixXd& after) {
  if (before.size() == 0) return {};
  const VectorXd scale = before.diagonal().unaryExpr([](double x) { return x > 0 ? 1 / std::sqrt(x) : 0.0; });
  const Eigen::SelfAdjointEigenSolver<MatrixXd> whole(scale.asDiagonal() * before * scale.asDiagonal());
  std::vector<Index> kept;
  for (Index i = 0; i < whole.eigenvalues().size(); ++i) {
    if (whole.eigenvalues()[i] > 1e-10 * whole.eigenvalues().maxCoeff() && whole.eigenvalues()[i] > 0)
      kept.push_back(i);
  }
  MatrixXd basis = scale.asDiagonal() * whole.eigenvectors()(Eigen::all, kept);
  for (std::size_t i = 0; i < kept.size(); ++i)
    basis.col(static_cast<Index>(i)) /= std::sqrt(whole.eigenvalues()[kept[i]]);
  if (kept.empty()) return {basis, VectorXd()};
  const Eigen::SelfAdjointEigenSolver<MatrixXd> left(basis.transpose() * after * basis);
  return {basis * left.eigenvectors(), left.eigenvalues().cwiseMax(0.0).cwiseMin(1.0)};
}

/// The directions of which something is left, scaled to unit information after the nominal model.
MatrixXd left_over(const Directions& d) {
  std::vector<Index> kept;
  for (Index i = 0; i < d.square.size(); ++i) {
    if (d.square[i] >= nothing_left) kept.push_back(i);
  }
  MatrixXd u = d.u(Eigen::all, kept);
  for (std::size_t i = 0; i < kept.size(); ++i) u.col(static_cast<Index>(i)) /= std::sqrt(d.square[kept[i]]);
  return u;
}

Visibility visibility(const Block& block, const MatrixXd& before, const MatrixXd& after, double threshold,
                      const VectorXd& rated) {
  Visibility out;
  out.shape = block.candidate.shape;
  out.parameters.assign(static_cast<std::size_t>(block.count), std::numeric_limits<double>::infinity());
  const Directions d = directions(before, after);
  if (d.square.size() == 0) return out;
  double sum = 0, inverse_squares = 0;
  int kept = 0;
  for (Index i = 0; i < d.square.size(); ++i) {
    if (d.square[i] < nothing_left) continue;
    double felt = 0;  // squared, share of rated torque
    for (std::size_t j = 0; j < block.raw.size(); ++j) {
      if (block.raw[j].size() == 0) continue;
      const double rms = d.u.col(i).dot(block.raw[j] * d.u.col(i));
      felt = std::max(felt, rms / (rated[static_cast<Index>(j)] * rated[static_cast<Index>(j)]));
    }
    sum += d.square[i];
    inverse_squares += d.square[i] / (threshold * threshold * felt);
    ++kept;
  }
  out.rho = kept > 0 ? std::sqrt(sum / kept) : std::sqrt(d.square.maxCoeff());
  if (kept > 0) out.smallest = std::sqrt(kept / inverse_squares);
  for (Index i = 0; i < block.count; ++i) {
    // A parameter alone, the effect's others zero.
    if (before(i, i) > 0 && after(i, i) >= nothing_left * before(i, i))
      out.parameters[static_cast<std::size_t>(i)] = threshold / std::sqrt(after(i, i));
  }
  return out;
}

/// Share (RMS) of what is left of `e` that `f` can take.
double correlation(const MatrixXd& e, const MatrixXd& f, const MatrixXd& between) {
  if (e.cols() == 0 || f.cols() == 0) return 0;
  return std::min(1.0, std::sqrt((e.transpose() * between * f).squaredNorm() / static_cast<double>(e.cols())));
}

void check(const IdentifiedModel& nominal, const std::vector<Motion>& motions, const SightSettings& settings) {
  const auto n = static_cast<Index>(robot_of(nominal).size());
  if (motions.empty()) throw InputError("no motion to judge");
  if (settings.noise.size() != n || !(settings.noise.minCoeff() > 0))
    throw InputError(fmt::format("torque noise: expected {} positive values, one a joint", n));
  for (const Motion& motion : motions) {
    if (motion.step_s != motions.front().step_s) {
      throw InputError(fmt::format("motion '{}' has steps of {} s, '{}' of {} s: sample them alike", motion.name,
                                   motion.step_s, motions.front().name, motions.front().step_s));
    }
    if (motion.t.size() < 2 || motion.t.size() != motion.q.rows())
      throw InputError(
          fmt::format("motion '{}': {} instants for {} positions", motion.name, motion.t.size(), motion.q.rows()));
    if (motion.q.cols() != n || motion.dq.cols() != n || motion.ddq.cols() != n ||
        motion.dq.rows() != motion.q.rows() || motion.ddq.rows() != motion.q.rows()) {
      throw InputError(fmt::format("motion '{}': expected {} joints with q, dq and ddq", motion.name, n));
    }
  }
  for (std::size_t j = 0; j < joints_of(nominal).size(); ++j) {
    if (!(joints_of(nominal)[j].rated_torque > 0))
      throw InputError(fmt::format("joint {}: its rated torque is not known", j + 1));
  }
}

/// Answers questions to the information.
class Judge {
 public:
  Judge(const IdentifiedModel& nominal, const Information& information, double threshold);
  EffectSight effect(std::string_view name, std::optional<std::size_t> joint) const;

 private:
  /// What the nominal columns without those of `left_out` leave of all columns.
  MatrixXd after_nominal(const std::vector<const Block*>& left_out) const;
  std::vector<const Block*> shapes_of(std::string_view effect, std::optional<std::size_t> joint) const;
  Visibility seen(const Block& block, const MatrixXd& after) const;
  /// Columns in which an effect differs from the nominal model: without the offset of a spring. All where none does.
  std::vector<Index> own_columns(const Block& block) const;

  const Information& info_;
  double threshold_;
  VectorXd rated_;
  std::vector<Index> nominal_columns_;
  MatrixXd after_, after_healthy_, after_base_;
  std::vector<MatrixXd> without_;  ///< after_nominal() without nominal block b
};

Judge::Judge(const IdentifiedModel& nominal, const Information& information, double threshold)
    : info_(information), threshold_(threshold) {
  rated_.resize(static_cast<Index>(joints_of(nominal).size()));
  for (std::size_t j = 0; j < joints_of(nominal).size(); ++j)
    rated_[static_cast<Index>(j)] = joints_of(nominal)[j].rated_torque;
  const Index base = info_.base;
  const Block& last = info_.blocks[info_.nominal_blocks - 1];
  nominal_columns_ = columns_from(0, last.first + last.count);
  after_ = after_nominal({});
  const MatrixXd& g = info_.gram;
  const auto all = nominal_columns_;
  const auto inertia = columns_from(0, base), friction = columns_from(base, last.first + last.count - base);
  after_base_ = information_left(g, g.topRows(base), g.topLeftCorner(base, base));
  // A healthy recording of the same motions determines the base parameters, its friction fitted apart.
  MatrixXd nuisance = g(all, all);
  nuisance.topLeftCorner(base, base) +=
      information_left(g(inertia, inertia), g(friction, inertia), g(friction, friction));
  after_healthy_ = information_left(g, g(all, Eigen::all), nuisance);
  without_.resize(info_.nominal_blocks);
  parallel_for(without_.size(), [&](std::size_t b) { without_[b] = after_nominal({&info_.blocks[b]}); });
}

MatrixXd Judge::after_nominal(const std::vector<const Block*>& left_out) const {
  std::vector<Index> columns;
  for (const Index i : nominal_columns_) {
    const bool out = std::any_of(left_out.begin(), left_out.end(), [&](const Block* block) {
      return i >= block->first && i < block->first + block->count;
    });
    if (!out) columns.push_back(i);
  }
  const MatrixXd& g = info_.gram;
  return information_left(g, g(columns, Eigen::all), g(columns, columns));
}

std::vector<const Block*> Judge::shapes_of(std::string_view effect, std::optional<std::size_t> joint) const {
  std::vector<const Block*> shapes;
  for (const Block& block : info_.blocks) {
    if (block.candidate.effect == effect && (block.on_body || block.candidate.joint == joint)) shapes.push_back(&block);
  }
  return shapes;
}

std::vector<Index> Judge::own_columns(const Block& block) const {
  auto columns = columns_from(block.first, block.count);
  if (block.first < static_cast<Index>(nominal_columns_.size())) return columns;
  auto own = columns;
  std::erase_if(own, [&](Index i) { return after_(i, i) < nothing_left * info_.gram(i, i); });
  return own.empty() ? columns : own;
}

Visibility Judge::seen(const Block& block, const MatrixXd& after) const {
  const auto columns = columns_from(block.first, block.count);
  return visibility(block, info_.gram(columns, columns), after(columns, columns), threshold_, rated_);
}

EffectSight Judge::effect(std::string_view name, std::optional<std::size_t> joint) const {
  EffectSight out;
  out.effect = name;
  out.joint = joint;
  const auto shapes = shapes_of(name, joint);
  const Block& typical = *shapes.front();
  const auto own = static_cast<std::size_t>(&typical - info_.blocks.data());
  const bool nominal = own < info_.nominal_blocks;
  const MatrixXd& after = nominal ? without_[own] : after_;

  for (const Block* shape : shapes) {
    const Visibility v = seen(*shape, after);
    if (shape == &typical) out.typical = out.worst = v;
    if (v.smallest > out.worst.smallest) out.worst = v;
  }
  if (!nominal) out.healthy = seen(typical, after_healthy_);
  if (std::isfinite(out.typical.smallest))
    out.verdict = out.typical.smallest <= seen_below ? SightVerdict::seen : SightVerdict::weak;

  const auto note = [&](const std::string& other, double r) {
    if (r < confused_from) return;
    const auto known =
        std::find_if(out.confused.begin(), out.confused.end(), [&](const Confusion& c) { return c.effect == other; });
    if (known == out.confused.end()) {
      out.confused.push_back({other, r, cure(out.effect, other)});
    } else {
      known->correlation = std::max(known->correlation, r);
    }
  };
  // What no column of a joint's friction is needed for, the base parameters take.
  const auto here = columns_from(typical.first, typical.count);
  const Directions alone = directions(info_.gram(here, here), after_base_(here, here));
  if (alone.square.size() > 0) note(std::string(base_parameters_name), std::sqrt(1 - alone.square.mean()));
  for (std::size_t b = 0; b < info_.blocks.size(); ++b) {
    const Block& other = info_.blocks[b];
    if (other.candidate.effect == name) continue;
    if (joint && !other.on_body && other.candidate.joint != *joint) continue;
    // A nominal effect is compared before it has taken its part.
    MatrixXd both;
    const MatrixXd* left = &after;
    if (b < info_.nominal_blocks) {
      if (nominal) both = after_nominal({&typical, &other});
      left = nominal ? &both : &without_[b];
    }
    const auto e = own_columns(typical), f = own_columns(other);
    const auto left_of = [&](const std::vector<Index>& columns) {
      return left_over(directions(info_.gram(columns, columns), (*left)(columns, columns)));
    };
    note(other.candidate.effect, correlation(left_of(e), left_of(f), (*left)(e, f)));
  }
  std::stable_sort(out.confused.begin(), out.confused.end(),
                   [](const Confusion& a, const Confusion& b) { return a.correlation > b.correlation; });
  return out;
}

}  // namespace

std::string_view to_string(SightVerdict verdict) {
  static constexpr std::array names{"seen", "weak", "not_identifiable"};
  return names[static_cast<std::size_t>(verdict)];
}

Sight see(const IdentifiedModel& nominal, const std::vector<Motion>& motions, const SightSettings& settings,
          Progress& progress) {
  check(nominal, motions, settings);
  const Information information(nominal, motions, settings.noise, settings.torque_cutoff_hz, progress);
  const double known = static_cast<double>(robot_of(nominal).size()) * information.independent_samples;
  const double asked =
      static_cast<double>(information.base) + static_cast<double>(nominal_effects().size() * robot_of(nominal).size());
  if (known < 2 * asked) {
    throw DataError(
        fmt::format("{:.2f} s of motion hold {:.0f} independent torques for {:.0f} nominal parameters: plan "
                    "a longer motion",
                    information.seconds, known, asked));
  }
  const Judge judge(nominal, information, settings.threshold);
  Sight sight;
  sight.robot = robot_of(nominal);
  sight.torque_cutoff_hz = information.filter.torque_cutoff_hz;
  sight.threshold = settings.threshold;
  sight.seconds = information.seconds;
  sight.independent_samples = information.independent_samples;
  sight.noise = information.noise;
  for (Index j = 0; j < sight.noise.size(); ++j)
    sight.noise[j] /= joints_of(nominal)[static_cast<std::size_t>(j)].rated_torque;
  std::vector<std::pair<std::string_view, std::optional<std::size_t>>> questions;
  for (const Block& block : information.blocks) {
    const auto joint = block.on_body ? std::nullopt : std::optional(block.candidate.joint);
    if (std::find(questions.begin(), questions.end(), std::pair(std::string_view(block.candidate.effect), joint)) ==
        questions.end())
      questions.emplace_back(block.candidate.effect, joint);
  }
  sight.effects.resize(questions.size());
  parallel_for(questions.size(),
               [&](std::size_t i) { sight.effects[i] = judge.effect(questions[i].first, questions[i].second); });
  const auto place = [](const EffectSight& e) { return find_effect(e.effect) - effect_infos().data(); };
  std::stable_sort(sight.effects.begin(), sight.effects.end(),
                   [&](const EffectSight& a, const EffectSight& b) { return place(a) < place(b); });
  return sight;
}

}  // namespace fxdyn
