#include "host_tools/diagnose/search.hpp"
#include "host_tools/diagnose/ripples.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "host_tools/diagnose/refine.hpp"
#include "host_tools/diagnose/shifted_residual.hpp"
#include "host_tools/effects/effect_roles.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// How far the search goes, no thresholds: sets that are followed, on so many first levels; candidates of a state whose
/// shapes are refined; ripples of a joint that are tried; rounds of swaps; levels at most; rivals that take over.
constexpr std::size_t beam_width = 3, most_refined = 4, most_ripples = 3;
constexpr int beam_levels = 3, swap_rounds = 4, most_levels = 64, most_swaps = 2;
/// Residuals at other times, from whose scores Gumbel's distribution is taken.
constexpr int shifts = 24;
/// Gumbel's distribution: its scale over the standard deviation, sqrt(6) / pi; its mean beyond the mode, Euler's
/// constant.
constexpr double gumbel_scale = 0.7797, gumbel_mean = 0.5772;
/// A numeric floor under the residual's variance, of that at the start: data without noise.
constexpr double noise_free = 1e-12;
/// Bounds below are none.
constexpr double no_bound = -1e5;

bool contains(const EffectCandidate& whole, const EffectCandidate& part) {
  const auto& unites = find_effect(whole.effect)->unites;
  return std::find(unites.begin(), unites.end(), part.effect) != unites.end();
}

/// Whether no log that judges fits as well.
bool other_logs_judge(const Blocks& blocks) {
  for (const Fold& fold : blocks.folds) {
    for (const std::size_t judge : fold.judge) {
      for (const std::size_t fit : fold.fit) {
        if (blocks.all[fit].log == blocks.all[judge].log) return false;
      }
    }
  }
  return true;
}

bool of_spectrum(const Group& group) { return find_effect(group.candidate.effect)->of_spectrum(); }

}  // namespace

const SearchOptions& Search::options() const { return problem_.options().search; }

double Search::samples() const {
  double rows = 0;
  for (const std::size_t b : problem_.blocks().fit) {
    if (!problem_.blocks().all[b].healthy) rows += static_cast<double>(problem_.blocks().all[b].count);
  }
  return rows;
}

double Search::penalty(std::size_t g) const {
  const Group& group = problem_.groups()[g];
  const auto linear = static_cast<double>(group.in_model ? group.count - group.nonlinear : group.count);
  const bool share = group.in_model && find_effect(group.candidate.effect)->share;
  return (linear + group.nonlinear - (share ? 1 : 0)) * std::log(samples()) + 2 * group.log_grid;
}

double Search::threshold(std::size_t g) const {
  const Group& group = problem_.groups()[g];
  if (thresholds_.size() == 0) return options().least_score;
  if (!group.on_body) return thresholds_[static_cast<Index>(group.candidate.joint)];
  // What a load would stand in for may be on any joint that feels it.
  double most = options().least_score;
  for (std::size_t j = 0; j < problem_.joints(); ++j) {
    if (problem_.solver().rows(j).place(group.first) >= 0) most = std::max(most, thresholds_[static_cast<Index>(j)]);
  }
  return most;
}

Index first_of_groups(const Linearised& problem, const Choice& choice) {
  auto first = static_cast<Index>(choice.fit.columns.size());
  for (const std::size_t g : choice.groups) first -= problem.groups()[g].count;
  return first;
}

/// Without a healthy session a load is part of the last link.
bool Search::is_of_links(const Group& group) const {
  return is_load(group.candidate.effect) && !problem_.has_baseline();
}

bool Search::allowed(const Choice& state, std::size_t g) const {
  const Group& group = problem_.groups()[g];
  if (!group.in_model && !group.on_body && find_effect(group.candidate.effect)->needs_total) {
    // The total that its column is made of has the model's named effects in it: one that is left out would be stood in
    // for.
    for (std::size_t i = 0; i < problem_.groups().size() && problem_.groups()[i].in_model; ++i) {
      const bool elsewhere =
          !problem_.groups()[i].on_body && problem_.groups()[i].candidate.joint != group.candidate.joint;
      if (!elsewhere && std::find(state.groups.begin(), state.groups.end(), i) == state.groups.end()) return false;
    }
  }
  if (is_of_links(group) || state.groups.size() >= task_.settings.most) return false;
  std::size_t here = 0, robot = 0;
  for (const std::size_t other : state.groups) {
    const Group& o = problem_.groups()[other];
    if (o.on_body) ++robot;
    if (!o.on_body && o.candidate.joint == group.candidate.joint) ++here;
    // Both have dq_k: together they are two large torques that cancel.
    const auto couples = [](const Group& one) { return find_effect(one.candidate.effect)->needs_peers; };
    if (couples(group) && couples(o) && o.candidate.joint == group.candidate.joint &&
        o.candidate.shape[0] == group.candidate.shape[0])
      return false;
    if (o.on_body != group.on_body || o.candidate.effect != group.candidate.effect) continue;
    if (!group.on_body && o.candidate.joint != group.candidate.joint) continue;
    if (!find_effect(group.candidate.effect)->several) return false;
    // The same ripple or coupling again.
    const double a = o.candidate.shape[0], b = group.candidate.shape[0];
    if (std::fabs(a - b) < options().same_ripple * std::max(a, b) || !of_spectrum(o)) {
      if (of_spectrum(o) || a == b) return false;
    }
  }
  return group.on_body ? robot < task_.settings.robot_effects : here < task_.settings.max_effects;
}

Choice Search::evaluate(const std::vector<std::size_t>& groups) const {
  Choice out;
  out.groups = groups;
  out.fit = problem_.solver().solve(problem_.columns_of(groups));
  out.score = 0;
  for (Index j = 0; j < out.fit.square.size(); ++j) {
    const double floor = out.fit.rows[j] / problem_.solver().weights()[j] * noise_free;
    out.score -= out.fit.rows[j] * std::log((out.fit.square[j] + floor) / out.fit.rows[j]);
  }
  for (const std::size_t g : groups) out.score -= penalty(g);
  const SymmetricSolver solver(out.fit.information);
  Index column = first_of_groups(problem_, out);
  MatrixXd inverse;
  for (const std::size_t g : groups) {
    const Group& group = problem_.groups()[g];
    bool possible = true;
    for (Index i = 0; i < group.count; ++i, ++column) {
      if (group.lower[static_cast<std::size_t>(i)] < no_bound) continue;
      const double x = out.fit.x[column], below = group.lower[static_cast<std::size_t>(i)] - x;
      if (below <= 0) continue;
      if (inverse.size() == 0) inverse = solver.inverse();
      possible &= group.count > 1 && below < options().beyond_bound * std::sqrt(std::max(inverse(column, column), 0.0));
    }
    if (is_share(group)) {
      const double share = out.fit.x[column - 1];
      possible &= share > options().least_share && share < options().most_share;
    }
    out.impossible += possible ? 0 : 1;
  }
  return out;
}

/// One over the variance of what a fit leaves of each joint; noise-free joints are no better known than to 1e-12.
VectorXd Search::weights_of(const LinearFit& fit) const {
  VectorXd out(fit.rows.size());
  for (Index j = 0; j < out.size(); ++j)
    out[j] = fit.rows[j] / std::max(fit.square[j], noise_free * fit.rows[j] / problem_.solver().weights()[j]);
  return out;
}

Search::Candidates Search::project(const Choice& state) {
  const BlockSolver& solver = problem_.solver();
  const std::size_t n = problem_.groups().size();
  MatrixXd gram;
  VectorXd projection;
  solver.normal(state.fit.columns, solver.blocks().fit, gram, projection);
  Candidates out;
  out.first = static_cast<Index>(problem_.unknowns().size());
  const MatrixXd cross = solver.cross(state.fit.columns, out.first);
  const MatrixXd inverse = SymmetricSolver(gram).inverse();
  out.by_state = inverse * cross;
  const VectorXd own = solver.projection(out.first) - out.by_state.transpose() * projection;
  const bool at_start = kept_.empty();
  if (at_start) kept_.assign(n, 0.0);
  out.products.resize(n);
  out.gain.resize(n);
  out.usable.assign(n, 0);
  for (std::size_t g = 0; g < n; ++g) {
    const Group& group = problem_.groups()[g];
    const bool open = allowed(state, g);
    if (group.in_model || group.count == 0 || (!open && !at_start)) continue;
    const Index first = group.first - out.first;
    const MatrixXd mine = solver.gram(group.first, group.count);
    out.products[g].size = mine.diagonal();
    out.products[g].gram =
        mine - cross.middleCols(first, group.count).transpose() * out.by_state.middleCols(first, group.count);
    out.products[g].projection = own.segment(first, group.count);
    out.gain[g] = gain_of(out.products[g], group.lower, is_share(group), options().beyond_bound);
    if (at_start) kept_[g] = is_of_links(group) ? 0 : out.gain[g].kept;
    if (out.gain[g].rank > 0 && open) out.usable[g] = 1;
  }
  return out;
}

std::vector<Search::Scored> Search::score_all(const Choice& state, bool with_thresholds) {
  if (problem_.solver().columns() == static_cast<Index>(problem_.unknowns().size())) return {};  // no candidates
  const VectorXd before = problem_.solver().weights();
  problem_.solver().set_weights(weights_of(state.fit));
  const Candidates candidates = project(state);
  std::vector<Scored> out;
  for (std::size_t g = 0; g < problem_.groups().size(); ++g) {
    const Gain& gain = candidates.gain[g];
    const Group& group = problem_.groups()[g];
    if (candidates.usable[g] == 0 || gain.square <= 0) continue;
    double likelihood = gain.square;
    if (!group.on_body && find_effect(group.candidate.effect)->acts_on == ActsOn::torque) {
      // all of it is one joint's
      const double rows = state.fit.rows[static_cast<Index>(group.candidate.joint)];
      likelihood = -rows * std::log(std::max(noise_free, 1 - std::min(gain.square / rows, 1.0)));
    }
    out.push_back({g, likelihood - penalty(g) + absorbed(group, gain)});
  }
  std::sort(out.begin(), out.end(), [](const Scored& a, const Scored& b) {
    return a.score != b.score ? a.score > b.score : a.group < b.group;
  });
  if (with_thresholds) estimate_thresholds(state, candidates);
  problem_.solver().set_weights(before);
  return out;
}

/// A direction that the nuisance absorbs is no parameter.
double Search::absorbed(const Group& group, const Gain& gain) const {
  return static_cast<double>(group.count - gain.rank) * std::log(samples());
}

void Search::estimate_thresholds(const Choice& state, const Candidates& candidates) {
  std::vector<double> result(problem_.joints());
  parallel_for(problem_.joints(), [&](std::size_t j) {
    const VectorXd most = scores_of_noise(j, state, candidates);
    // Gumbel's distribution of the largest, by moments
    const double mean = most.mean(), std = std::sqrt((most.array() - mean).square().sum() / (shifts - 1));
    const double beta = std * gumbel_scale, mode = mean - gumbel_mean * beta;
    result[j] = std::clamp(mode - beta * std::log(-std::log1p(-options().false_alarm)), options().least_score,
                           options().most_score);
  });
  thresholds_ = Eigen::Map<const VectorXd>(result.data(), static_cast<Index>(result.size()));
}

/// The largest scores of a joint's candidates for its residual at other times, which has the same noise and nothing to
/// do with the motion: one a shift.
VectorXd Search::scores_of_noise(std::size_t joint, const Choice& state, const Candidates& candidates) const {
  const JointRows& rows = problem_.solver().rows(joint);
  const VectorXd e = problem_.solver().residual(joint, state.fit);
  Random random(977 + joint);
  MatrixXd shifted = MatrixXd::Zero(e.size(), shifts);
  for (const Block& b : problem_.blocks().of_log) {
    if (!b.fits || b.healthy) continue;
    for (int k = 0; k < shifts; ++k) shift(random, e, b, shifted.col(k));
  }
  const MatrixXd products = problem_.solver().weights()[static_cast<Index>(joint)] * (rows.x.transpose() * shifted);
  const std::vector<Index>& s = state.fit.columns;
  MatrixXd of_state = MatrixXd::Zero(static_cast<Index>(s.size()), shifts);
  for (std::size_t i = 0; i < s.size(); ++i) {
    const Index local = rows.place(s[i]);
    if (local >= 0) of_state.row(static_cast<Index>(i)) = products.row(local);
  }
  VectorXd most = VectorXd::Constant(shifts, -30.0);
  for (std::size_t g = 0; g < problem_.groups().size(); ++g) {
    const Group& group = problem_.groups()[g];
    if (candidates.usable[g] == 0 || group.on_body || group.candidate.joint != joint || of_spectrum(group)) continue;
    const Index local = rows.place(group.first);
    if (local < 0) continue;
    const MatrixXd b =
        products.middleRows(local, group.count) -
        candidates.by_state.middleCols(group.first - candidates.first, group.count).transpose() * of_state;
    Reduced reduced = candidates.products[g];
    for (Index k = 0; k < shifts; ++k) {
      reduced.projection = b.col(k);
      const Gain gain = gain_of(reduced, group.lower, false, options().beyond_bound);
      most[k] = std::max(most[k], gain.square - penalty(g) + absorbed(group, gain));
    }
  }
  return most;
}

std::size_t Search::refine(const Choice& state, std::size_t g) {
  const Group& start = problem_.groups()[g];
  const std::optional<Refined> better = refined(problem_, state.fit, start);
  if (!start.on_body) problem_.log_columns().forget_shared(start.candidate.joint);
  return better ? problem_.add(better->group, better->columns) : g;
}

void Search::find_ripples(const Choice& state, std::optional<std::size_t> joint) {
  std::vector<std::vector<Group>> found(problem_.joints());
  parallel_for(problem_.joints(), [&](std::size_t j) {
    if (!joint || j == *joint) found[j] = ripples(problem_, j, problem_.solver().residual(j, state.fit), most_ripples);
  });
  std::vector<Group> fresh;
  for (const auto& of_joint : found) {
    for (const Group& group : of_joint) {
      const bool known = std::any_of(problem_.groups().begin(), problem_.groups().end(), [&](const Group& g) {
        return g.candidate.effect == group.candidate.effect && g.candidate.joint == group.candidate.joint &&
               std::fabs(g.candidate.shape[0] - group.candidate.shape[0]) < 1e-9;
      });
      if (!known) fresh.push_back(group);
    }
  }
  problem_.add_all(std::move(fresh));
}

Choice Search::run(const std::vector<std::size_t>& start, Progress& progress) {
  std::vector<Choice> beam{evaluate(start)};
  Choice best = beam.front();
  for (int level = 0; level < most_levels; ++level) {
    // A ripple may show only once what was larger on its joint is gone.
    if (level < 2) {
      find_ripples(beam.front(), {});
    } else if (const Group last = problem_.groups()[best.groups.back()]; !last.on_body) {
      find_ripples(best, last.candidate.joint);
    }
    std::vector<Choice> next;
    std::set<std::vector<std::size_t>> seen;
    const std::size_t width = level < beam_levels ? beam.size() : 1;
    for (std::size_t s = 0; s < width; ++s) {
      for (const Scored& one : worth_trying(score_all(beam[s], s == 0))) {
        if (one.score < options().refine_from * threshold(one.group)) continue;
        const double needed = threshold(one.group);
        std::vector<std::size_t> groups = beam[s].groups;
        groups.push_back(refine(beam[s], one.group));
        std::vector<std::size_t> key = groups;
        std::sort(key.begin(), key.end());
        if (!seen.insert(key).second) continue;
        Choice choice = evaluate(groups);
        if (choice.possible() && choice.score > beam[s].score + needed) next.push_back(std::move(choice));
      }
    }
    progress.step();
    if (next.empty()) break;
    std::sort(next.begin(), next.end(), [](const Choice& a, const Choice& b) { return a.score > b.score; });
    if (next.size() > beam_width) next.resize(beam_width);
    // A longer set must be better than the best shorter one by what one effect has to bring.
    if (next.front().score < best.score + options().least_score) break;
    beam = std::move(next);
    best = beam.front();
  }
  // Early choices stand in for others: swap, trade and drop, the last round drops only.
  for (int round = 0; round < swap_rounds; ++round) {
    bool changed = round < swap_rounds - 1 && trade(best);
    for (std::size_t i = 0; i < best.groups.size(); ++i) {
      std::vector<std::size_t> others = best.groups;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      const Choice without = evaluate(others);
      if (best.score - without.score < threshold(best.groups[i])) {
        best = without;
        changed = true;
        break;
      }
      if (round == swap_rounds - 1) continue;
      for (const Scored& one : worth_trying(score_all(without, false))) {
        if (one.score < best.score - without.score - options().swap_behind) continue;
        std::vector<std::size_t> groups = others;
        groups.push_back(refine(without, one.group));
        Choice choice = evaluate(groups);
        if (!choice.possible() || choice.score <= best.score + options().swap_gain) continue;
        best = std::move(choice);
        changed = true;
      }
    }
    if (!changed) break;
  }
  return best;
}

/// The best of each effect at each joint, so many of them; and the best of each effect on the robot: its first score is
/// of a linear likelihood, where those of joints count how much of the joint's whole gap they close.
std::vector<Search::Scored> Search::worth_trying(const std::vector<Scored>& scored) const {
  std::vector<Scored> out;
  std::set<std::pair<std::string, std::size_t>> seen;
  std::size_t of_joints = 0;
  for (const Scored& one : scored) {
    const Group& group = problem_.groups()[one.group];
    if (!group.on_body && of_joints == most_refined) continue;
    if (!seen.insert({group.candidate.effect, group.on_body ? 0 : group.candidate.joint}).second) continue;
    if (!group.on_body) ++of_joints;
    out.push_back(one);
  }
  return out;
}

double Search::held_out(const Choice& choice, const VectorXd& weights) const {
  const BlockSolver& solver = problem_.solver();
  double sum = 0;
  for (const Fold& fold : problem_.blocks().folds)
    sum += solver.square(solver.solve(choice.fit.columns, fold.fit), fold.judge).dot(weights);
  return sum;
}

std::vector<Found> Search::explain(Choice& choice) {
  std::vector<Found> out;
  for (int swap = 0;; ++swap) {
    std::optional<Choice> better;
    out = explain(choice, better);
    // On data that fitted neither.
    if (!better || swap == most_swaps) return out;
    choice = std::move(*better);
  }
}

std::vector<Found> Search::explain(const Choice& choice, std::optional<Choice>& better) {
  // Parts of a motion that was fitted like whatever bends to that motion.
  const bool others_judge = other_logs_judge(problem_.blocks());
  const double clear = -2 * std::numbers::ln10 * problem_.options().gate.likely;
  double least = clear;
  std::vector<Found> out;
  const VectorXd weights = weights_of(choice.fit);
  const double own = held_out(choice, weights);
  for (std::size_t i = 0; i < choice.groups.size(); ++i) {
    Found found;
    found.group = choice.groups[i];
    const Group mine = problem_.groups()[found.group];
    std::vector<std::size_t> others = choice.groups;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const Choice without = evaluate(others);
    found.score = choice.score - without.score;
    for (const Scored& one : worth_trying(score_all(without, false))) {
      if (one.score <= 0) break;
      const Group group = problem_.groups()[one.group];
      if (group.candidate.effect == mine.candidate.effect && group.on_body == mine.on_body &&
          (mine.on_body || group.candidate.joint == mine.candidate.joint))
        continue;
      // A law comes in place of its parts, not beside them.
      if (std::any_of(others.begin(), others.end(), [&](std::size_t g) {
            const EffectCandidate& other = problem_.groups()[g].candidate;
            return other.joint == group.candidate.joint && contains(group.candidate, other);
          }))
        continue;
      std::vector<std::size_t> groups = others;
      groups.push_back(refine(without, one.group));
      const Choice instead = evaluate(groups);
      // What else of the set has left its bounds since it was chosen is not the rival's fault.
      if (instead.impossible > choice.impossible) continue;
      if (instead.score > choice.score - options().alternative)
        found.alternatives.push_back({problem_.groups()[groups.back()].candidate, choice.score - instead.score});
      // What has the effect as a special case is no rival that data refute: unite() chose between the two.
      if (contains(group.candidate, mine.candidate)) continue;
      // The set won where it was fitted, prices paid: a rival that bends more has its further price to pay here, too.
      const double gain =
          held_out(instead, weights) - own + std::max(0.0, penalty(groups.back()) - penalty(found.group));
      // Several effects give way to one on the robot in trade().
      const bool same_place = group.on_body == mine.on_body && group.candidate.joint == mine.candidate.joint;
      if (others_judge && same_place && gain < least && instead.score - without.score >= threshold(groups.back())) {
        least = gain;
        better = instead;
      }
      if (!found.rival || gain < found.rival->gain) {
        const Group& rival = problem_.groups()[groups.back()];
        found.rival = Rival{rival, instead.fit.x.tail(rival.count), gain};
      }
    }
    std::sort(found.alternatives.begin(), found.alternatives.end(),
              [](const Alternative& a, const Alternative& b) { return a.behind < b.behind; });
    out.push_back(std::move(found));
  }
  return out;
}

}  // namespace fxdyn::diagnosis
