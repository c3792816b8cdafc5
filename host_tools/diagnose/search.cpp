#include "host_tools/diagnose/search.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "host_tools/effects/effects.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/support/parallel.hpp"
#include "host_tools/support/random.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// What an effect must bring at least.
constexpr double least_score = 8;
/// .. and at most: a residual full of structure looks like more than noise at other times too.
constexpr double most_score = 25;
/// Less of a column than this (squared) is nothing.
constexpr double nothing_left = 1e-5;
constexpr std::size_t beam_width = 3;
/// Shapes are refined for as many candidates of a state.
constexpr std::size_t refined = 4;
constexpr int shifts = 24;
/// Chance that a joint without anything to find passes the threshold, per level of the search.
constexpr double false_alarm = 1e-3;

/// What is left of a group's columns and their products with y once the state has taken its part, and what the group
/// gains: the largest reduction of the weighted squares within the bounds.
struct Left {
  MatrixXd gram;
  VectorXd projection;
};

struct Gain {
  double square = 0;  ///< of the weighted residual, less
  double kept = 0;    ///< largest share of a direction that is left, squared
  int rank = 0;
  VectorXd theta;
};

Gain gain_of(const Left& left, const VectorXd& before, const std::vector<double>& lower, bool share) {
  Gain out;
  const Index p = left.gram.rows();
  VectorXd scale = before.unaryExpr([](double x) { return x > 0 ? 1 / std::sqrt(x) : 0.0; });
  const MatrixXd g = scale.asDiagonal() * left.gram * scale.asDiagonal();
  const VectorXd b = scale.cwiseProduct(left.projection);
  out.theta = VectorXd::Zero(p);
  if (p == 1) {
    out.kept = g(0, 0);
    if (out.kept < nothing_left) return out;
    out.rank = 1;
    const double theta = b[0] / g(0, 0);
    out.theta[0] = theta * scale[0];
    if (out.theta[0] < lower[0]) return out;
    // A share that is 1 by definition counts with 1.
    out.square = share ? 2 * left.projection[0] - left.gram(0, 0) : theta * b[0];
    return out;
  }
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(g);
  out.kept = eigen.eigenvalues()[p - 1];
  VectorXd theta = VectorXd::Zero(p);
  for (Index i = 0; i < p; ++i) {
    const double value = eigen.eigenvalues()[i];
    if (value < nothing_left) continue;
    ++out.rank;
    const double along = eigen.eigenvectors().col(i).dot(b);
    out.square += along * along / value;
    theta += eigen.eigenvectors().col(i) * (along / value);
  }
  out.theta = scale.cwiseProduct(theta);
  // Bounds: clearly on the wrong side of one makes it something else.
  for (Index i = 0; i < p; ++i) {
    if (lower[static_cast<std::size_t>(i)] < -1e5 || out.theta[i] >= lower[static_cast<std::size_t>(i)]) continue;
    const double std = scale[i] / std::sqrt(std::max(g(i, i), 1e-12));
    if (out.theta[i] < lower[static_cast<std::size_t>(i)] - 3 * std) out.square = 0;
  }
  return out;
}

bool is_share(const Group& group) {
  return !group.in_model && find_effect(group.candidate.effect)->linear[0].name == "share";
}

bool of_spectrum(const Group& group) { return find_effect(group.candidate.effect)->of_spectrum(); }

}  // namespace

double Search::samples() const {
  double rows = 0;
  for (const std::size_t b : at_.fit_blocks()) {
    if (!at_.blocks()[b].healthy) rows += static_cast<double>(at_.blocks()[b].count);
  }
  return rows;
}

double Search::penalty(std::size_t g) const {
  const Group& group = at_.groups()[g];
  const auto linear = static_cast<double>(group.in_model ? group.count - group.nonlinear : group.count);
  const bool share = group.in_model && find_effect(group.candidate.effect)->linear[0].name == "share";
  return (linear + group.nonlinear - (share ? 1 : 0)) * std::log(samples()) + 2 * group.log_grid;
}

double Search::threshold(std::size_t g) const {
  const Group& group = at_.groups()[g];
  if (thresholds_.size() == 0) return least_score;
  if (!group.on_body) return thresholds_[static_cast<Index>(group.candidate.joint)];
  // What a load would stand in for may be on any joint that feels it.
  double most = least_score;
  for (std::size_t j = 0; j < at_.joints(); ++j) {
    if (at_.rows(j).local[static_cast<std::size_t>(group.first)] >= 0)
      most = std::max(most, thresholds_[static_cast<Index>(j)]);
  }
  return most;
}

Index first_of_groups(const Linearised& at, const Choice& choice) {
  auto first = static_cast<Index>(choice.fit.columns.size());
  for (const std::size_t g : choice.groups) first -= at.groups()[g].count;
  return first;
}

bool Search::allowed(const Choice& state, std::size_t g) const {
  const Group& group = at_.groups()[g];
  if (!group.in_model && !group.on_body && find_effect(group.candidate.effect)->needs_total) {
    // The total that its column is made of has the model's named effects in it: one that is left out would be stood in
    // for.
    for (std::size_t i = 0; i < at_.groups().size() && at_.groups()[i].in_model; ++i) {
      const bool elsewhere = !at_.groups()[i].on_body && at_.groups()[i].candidate.joint != group.candidate.joint;
      if (!elsewhere && std::find(state.groups.begin(), state.groups.end(), i) == state.groups.end()) return false;
    }
  }
  if (state.groups.size() >= settings_.most) return false;
  std::size_t here = 0, robot = 0;
  for (const std::size_t other : state.groups) {
    const Group& o = at_.groups()[other];
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
    if (std::fabs(a - b) < 0.1 * std::max(a, b) || !of_spectrum(o)) {
      if (of_spectrum(o) || a == b) return false;
    }
  }
  return group.on_body ? robot < settings_.robot_effects : here < settings_.max_effects;
}

Choice Search::evaluate(const std::vector<std::size_t>& groups) const {
  Choice out;
  out.groups = groups;
  out.fit = at_.solve(at_.columns_of(groups));
  out.score = 0;
  for (Index j = 0; j < out.fit.square.size(); ++j) {
    // noise-free data: below a billionth of the signal there is nothing to find
    const double floor = out.fit.rows[j] / at_.weights()[j] * 1e-12;
    out.score -= out.fit.rows[j] * std::log((out.fit.square[j] + floor) / out.fit.rows[j]);
  }
  for (const std::size_t g : groups) out.score -= penalty(g);
  const SymmetricSolver solver(out.fit.information);
  Index at = first_of_groups(at_, out);
  MatrixXd inverse;
  for (const std::size_t g : groups) {
    const Group& group = at_.groups()[g];
    for (Index i = 0; i < group.count; ++i, ++at) {
      if (group.lower[static_cast<std::size_t>(i)] < -1e5) continue;
      const double x = out.fit.x[at], below = group.lower[static_cast<std::size_t>(i)] - x;
      if (below <= 0) continue;
      if (inverse.size() == 0) inverse = solver.inverse();
      out.possible &= group.count > 1 && below < 3 * std::sqrt(std::max(inverse(at, at), 0.0));
    }
    if (!is_share(group)) continue;
    const double share = out.fit.x[at - 1];
    out.possible &= share > 0.4 && share < 2;
  }
  return out;
}

std::vector<Search::Scored> Search::score_all(const Choice& state, bool with_thresholds) {
  if (at_.columns() == static_cast<Index>(at_.unknowns().size())) return {};  // no candidates
  const std::vector<Index>& s = state.fit.columns;
  const auto from = static_cast<Index>(at_.unknowns().size());
  VectorXd weights(static_cast<Index>(at_.joints()));
  for (Index j = 0; j < weights.size(); ++j)
    weights[j] = state.fit.rows[j] / std::max(state.fit.square[j], 1e-12 * state.fit.rows[j] / at_.weights()[j]);
  const VectorXd before = at_.weights();
  at_.set_weights(weights);
  MatrixXd gram;
  VectorXd projection;
  at_.normal(s, at_.fit_blocks(), gram, projection);
  const MatrixXd cross = at_.cross(s, from);
  const SymmetricSolver solver(gram);
  const MatrixXd inverse = solver.inverse();
  const MatrixXd z = inverse * cross;
  const VectorXd own = at_.projection(from) - z.transpose() * projection;
  const bool first = kept_.empty();
  if (first) kept_.assign(at_.groups().size(), 0.0);
  std::vector<Scored> out;
  std::vector<Left> left(at_.groups().size());
  std::vector<VectorXd> size(at_.groups().size());
  std::vector<char> usable(at_.groups().size(), 0);
  for (std::size_t g = 0; g < at_.groups().size(); ++g) {
    const Group& group = at_.groups()[g];
    const bool open = allowed(state, g);
    if (group.in_model || group.count == 0 || (!open && !first)) continue;
    const Index at = group.first - from;
    const MatrixXd mine = at_.gram(group.first, group.count);
    size[g] = mine.diagonal();
    left[g].gram = mine - cross.middleCols(at, group.count).transpose() * z.middleCols(at, group.count);
    left[g].projection = own.segment(at, group.count);
    const Gain gain = gain_of(left[g], size[g], group.lower, is_share(group));
    if (first) kept_[g] = gain.kept;
    if (gain.rank == 0 || !open) continue;
    usable[g] = 1;
    if (gain.square <= 0) continue;
    double likelihood = gain.square;
    if (!group.on_body && find_effect(group.candidate.effect)->acts_on == ActsOn::torque) {
      // all of it is one joint's
      const double rows = state.fit.rows[static_cast<Index>(group.candidate.joint)];
      likelihood = -rows * std::log(std::max(1e-12, 1 - std::min(gain.square / rows, 1.0)));
    }
    // A direction that the nuisance absorbs is no parameter.
    const double absorbed = static_cast<double>(group.count - gain.rank) * std::log(samples());
    out.push_back({g, likelihood - penalty(g) + absorbed});
  }
  std::sort(out.begin(), out.end(), [](const Scored& a, const Scored& b) {
    return a.score != b.score ? a.score > b.score : a.group < b.group;
  });
  if (with_thresholds) {
    // The residual at other times has the same noise and nothing to do with the motion.
    thresholds_ = VectorXd::Constant(static_cast<Index>(at_.joints()), least_score);
    std::vector<double> result(at_.joints(), least_score);
    parallel_for(at_.joints(), [&](std::size_t j) {
      const JointRows& rows = at_.rows(j);
      const VectorXd e = at_.residual(j, state.fit);
      Random random(977 + j);
      MatrixXd shifted = MatrixXd::Zero(e.size(), shifts);
      for (std::size_t l = 0; l < at_.logs().size(); ++l) {
        const Block& b = at_.log_rows(l);
        if (!b.fits || b.healthy) continue;
        for (int k = 0; k < shifts; ++k) {
          const auto by = static_cast<Index>(random.uniform(0.08, 0.92) * static_cast<double>(b.count));
          shifted.block(b.first, k, b.count - by, 1) = e.segment(b.first + by, b.count - by);
          shifted.block(b.first + b.count - by, k, by, 1) = e.segment(b.first, by);
        }
      }
      const MatrixXd products = weights[static_cast<Index>(j)] * (rows.x.transpose() * shifted);
      MatrixXd of_state = MatrixXd::Zero(static_cast<Index>(s.size()), shifts);
      for (std::size_t i = 0; i < s.size(); ++i) {
        const Index local = rows.local[static_cast<std::size_t>(s[i])];
        if (local >= 0) of_state.row(static_cast<Index>(i)) = products.row(local);
      }
      VectorXd most = VectorXd::Constant(shifts, -30.0);
      for (std::size_t g = 0; g < at_.groups().size(); ++g) {
        const Group& group = at_.groups()[g];
        if (usable[g] == 0 || group.on_body || group.candidate.joint != j || of_spectrum(group)) continue;
        const Index local = rows.local[static_cast<std::size_t>(group.first)];
        if (local < 0) continue;
        const MatrixXd b = products.middleRows(local, group.count) -
                           z.middleCols(group.first - from, group.count).transpose() * of_state;
        for (Index k = 0; k < shifts; ++k) {
          const Gain gain = gain_of({left[g].gram, b.col(k)}, size[g], group.lower, false);
          const double absorbed = static_cast<double>(group.count - gain.rank) * std::log(samples());
          most[k] = std::max(most[k], gain.square - penalty(g) + absorbed);
        }
      }
      // Gumbel's distribution of the largest, by moments
      const double mean = most.mean(), std = std::sqrt((most.array() - mean).square().sum() / (shifts - 1));
      const double beta = std * 0.7797, mode = mean - 0.5772 * beta;
      result[j] = std::clamp(mode - beta * std::log(-std::log1p(-false_alarm)), least_score, most_score);
    });
    for (std::size_t j = 0; j < result.size(); ++j) thresholds_[static_cast<Index>(j)] = result[j];
  }
  at_.set_weights(before);
  return out;
}

std::size_t Search::refine(const Choice& state, std::size_t g) {
  const int searched = searched_shape(at_.groups()[g].candidate);
  if (searched < 0 && !at_.groups()[g].rotor) return g;
  const Group start = at_.groups()[g];
  const EffectInfo& info = *find_effect(start.candidate.effect);
  // The state's part of a new column.
  MatrixXd gram;
  VectorXd projection;
  at_.normal(state.fit.columns, at_.fit_blocks(), gram, projection);
  const MatrixXd inverse = SymmetricSolver(gram).inverse();
  const auto gain = [&](const Group& tried, std::vector<MatrixXd>& made) {
    made = at_.make(tried);
    Left left;
    left.gram = MatrixXd::Zero(start.count, start.count);
    left.projection = VectorXd::Zero(start.count);
    MatrixXd cross = MatrixXd::Zero(static_cast<Index>(state.fit.columns.size()), start.count);
    for (std::size_t j = 0; j < at_.joints(); ++j) {
      if (made[j].size() == 0) continue;
      const JointRows& rows = at_.rows(j);
      const double w = at_.weights()[static_cast<Index>(j)];
      for (const std::size_t b : at_.fit_blocks()) {
        const Block& block = at_.blocks()[b];
        if (block.healthy) continue;
        const auto c = made[j].middleRows(block.first, block.count);
        left.gram += w * c.transpose() * c;
        left.projection += w * c.transpose() * rows.y.segment(block.first, block.count);
        for (std::size_t i = 0; i < state.fit.columns.size(); ++i) {
          const Index at = rows.local[static_cast<std::size_t>(state.fit.columns[i])];
          if (at >= 0)
            cross.row(static_cast<Index>(i)) += w * rows.x.col(at).segment(block.first, block.count).transpose() * c;
        }
      }
      const auto more = made[j].bottomRows(rows.more_y.size());
      left.gram += w * more.transpose() * more;
      left.projection += w * more.transpose() * rows.more_y;
      for (std::size_t i = 0; i < state.fit.columns.size(); ++i) {
        const Index at = rows.local[static_cast<std::size_t>(state.fit.columns[i])];
        if (at >= 0 && more.rows() > 0) cross.row(static_cast<Index>(i)) += w * rows.more_x.col(at).transpose() * more;
      }
    }
    const VectorXd size = left.gram.diagonal();
    const MatrixXd z = inverse * cross;
    left.gram -= cross.transpose() * z;
    left.projection -= z.transpose() * projection;
    return gain_of(left, size, start.lower, is_share(start)).square;
  };
  Group fine = start;
  std::vector<MatrixXd> best_columns, made;
  double best = gain(fine, best_columns);
  const double first = best;
  // A column of an effect on the position costs a simulation.
  const int rounds = info.acts_on == ActsOn::torque ? 4 : 2;
  const auto search = [&](double& value, double ratio, double least, double most) {
    for (int round = 0; round < rounds; ++round, ratio = std::sqrt(ratio)) {
      const double centre = value;
      double next = centre;
      for (const double there : {std::max(least, centre / ratio), std::min(most, centre * ratio)}) {
        value = there;
        const double square = gain(fine, made);
        if (square <= best) continue;
        best = square;
        next = there;
        best_columns = made;
      }
      value = next;
    }
  };
  if (searched >= 0) {
    const auto index = static_cast<std::size_t>(searched);
    const ParameterInfo& shape = info.shape[index];
    const auto [least, most] = shape_limits(at_.models(), start.candidate.joint, info, shape);
    double ratio = 1.5;
    if (of_spectrum(start)) {
      const auto j = static_cast<Index>(start.candidate.joint);
      double range = 1e-9;
      for (std::size_t l = 0; l < at_.logs().size(); ++l) range = std::max(range, at_.logs()[l].log.q_range[j]);
      ratio = 1 + 1.0 / (range * start.candidate.shape[index]);
    }
    search(fine.candidate.shape[index], ratio, least, most);
  }
  if (fine.rotor_inertia > 0) search(fine.rotor_inertia, 1.25, 0, 1.1 * fine.rotor_inertia);
  return best > first ? at_.add(fine, best_columns) : g;
}

void Search::find_ripples(const Choice& state, std::optional<std::size_t> joint) {
  std::vector<std::vector<Group>> found(at_.joints());
  parallel_for(at_.joints(), [&](std::size_t j) {
    if (!joint || j == *joint) found[j] = ripples(at_, j, at_.residual(j, state.fit), 3);
  });
  std::vector<Group> fresh;
  for (const auto& of_joint : found) {
    for (const Group& group : of_joint) {
      const bool known = std::any_of(at_.groups().begin(), at_.groups().end(), [&](const Group& g) {
        return g.candidate.effect == group.candidate.effect && g.candidate.joint == group.candidate.joint &&
               std::fabs(g.candidate.shape[0] - group.candidate.shape[0]) < 1e-9;
      });
      if (!known) fresh.push_back(group);
    }
  }
  at_.add_all(std::move(fresh));
}

Choice Search::run(std::vector<std::size_t> start, Progress& progress) {
  std::vector<Choice> beam{evaluate(start)};
  Choice best = beam.front();
  for (int level = 0; level < 64; ++level) {
    // A ripple may show only once what was larger on its joint is gone.
    if (level < 2) {
      find_ripples(beam.front(), {});
    } else if (const Group last = at_.groups()[best.groups.back()]; !last.on_body) {
      find_ripples(best, last.candidate.joint);
    }
    std::vector<Choice> next;
    std::set<std::vector<std::size_t>> seen;
    const std::size_t width = level < 3 ? beam.size() : 1;
    for (std::size_t s = 0; s < width; ++s) {
      const std::vector<Scored> scored = score_all(beam[s], s == 0);
      std::set<std::pair<std::string, std::size_t>> tried;
      for (const Scored& one : scored) {
        const Group& group = at_.groups()[one.group];
        if (tried.size() >= refined || one.score < 0.5 * threshold(one.group)) break;
        if (!tried.insert({group.candidate.effect, group.on_body ? 0 : group.candidate.joint}).second) continue;
        const double needed = threshold(one.group);
        std::vector<std::size_t> groups = beam[s].groups;
        groups.push_back(refine(beam[s], one.group));
        std::vector<std::size_t> key = groups;
        std::sort(key.begin(), key.end());
        if (!seen.insert(key).second) continue;
        Choice choice = evaluate(groups);
        if (choice.possible && choice.score > beam[s].score + needed) next.push_back(std::move(choice));
      }
    }
    progress.step();
    if (next.empty()) break;
    std::sort(next.begin(), next.end(), [](const Choice& a, const Choice& b) { return a.score > b.score; });
    if (next.size() > beam_width) next.resize(beam_width);
    // A longer set must be better than the best shorter one by what one effect has to bring.
    if (next.front().score < best.score + least_score) break;
    beam = std::move(next);
    best = beam.front();
  }
  // Early choices stand in for others: swap and drop, the last round drops only.
  constexpr int rounds = 4;
  for (int round = 0; round < rounds; ++round) {
    bool changed = false;
    for (std::size_t i = 0; i < best.groups.size(); ++i) {
      std::vector<std::size_t> others = best.groups;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      const Choice without = evaluate(others);
      if (best.score - without.score < threshold(best.groups[i])) {
        best = without;
        changed = true;
        break;
      }
      if (round == rounds - 1) continue;
      std::size_t tried = 0;
      std::set<std::pair<std::string, std::size_t>> names;
      for (const Scored& one : score_all(without, false)) {
        const Group& group = at_.groups()[one.group];
        if (tried >= refined || one.score < best.score - without.score - 20) break;
        if (!names.insert({group.candidate.effect, group.on_body ? 0 : group.candidate.joint}).second) continue;
        ++tried;
        std::vector<std::size_t> groups = others;
        groups.push_back(refine(without, one.group));
        Choice choice = evaluate(groups);
        if (!choice.possible || choice.score <= best.score + 1) continue;
        best = std::move(choice);
        changed = true;
      }
    }
    if (!changed) break;
  }
  return best;
}

std::vector<Found> Search::explain(const Choice& choice) {
  std::vector<Found> out;
  for (std::size_t i = 0; i < choice.groups.size(); ++i) {
    Found found;
    found.group = choice.groups[i];
    const Group mine = at_.groups()[found.group];
    std::vector<std::size_t> others = choice.groups;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const Choice without = evaluate(others);
    found.score = choice.score - without.score;
    std::set<std::pair<std::string, std::size_t>> names;
    names.insert({mine.candidate.effect, mine.on_body ? 0 : mine.candidate.joint});
    std::size_t tried = 0;
    for (const Scored& one : score_all(without, false)) {
      const Group group = at_.groups()[one.group];
      if (tried >= 4 || one.score < found.score - std::max(25.0, 0.1 * found.score)) break;
      if (!names.insert({group.candidate.effect, group.on_body ? 0 : group.candidate.joint}).second) continue;
      ++tried;
      std::vector<std::size_t> groups = others;
      groups.push_back(refine(without, one.group));
      const Choice instead = evaluate(groups);
      if (instead.possible && instead.score > choice.score - settings_.within)
        found.alternatives.push_back({at_.groups()[groups.back()].candidate, choice.score - instead.score});
    }
    std::sort(found.alternatives.begin(), found.alternatives.end(),
              [](const Alternative& a, const Alternative& b) { return a.behind < b.behind; });
    out.push_back(std::move(found));
  }
  return out;
}

}  // namespace fxdyn::diagnosis
