#include <algorithm>
#include <cmath>
#include <set>

#include "host_tools/diagnose/dictionary.hpp"
#include "host_tools/diagnose/refine.hpp"
#include "host_tools/diagnose/search.hpp"
#include "host_tools/effects/joint_fit.hpp"

namespace fxdyn::diagnosis {
namespace {

bool is_united(const EffectInfo& info, std::string_view effect) {
  return std::find(info.unites.begin(), info.unites.end(), effect) != info.unites.end();
}

/// Value of the members' shape parameter of this name.
std::optional<double> shape_of(const std::vector<Group>& members, std::string_view name) {
  for (const Group& member : members) {
    const EffectInfo& info = *find_effect(member.candidate.effect);
    for (std::size_t i = 0; i < info.shape.size(); ++i) {
      if (info.shape[i].name == name) return member.candidate.shape[i];
    }
  }
  return {};
}

/// Shapes to begin with: those of the members, else usual ones.
std::vector<std::vector<double>> starts(const EffectInfo& info, const std::vector<Group>& members,
                                        const MotionScales& scales) {
  std::vector<std::vector<double>> values;
  for (const ParameterInfo& shape : info.shape) {
    if (const auto known = shape_of(members, shape.name)) {
      values.push_back({*known});
    } else {
      const ValueList usual = shape.values.judged(scales);
      values.emplace_back(usual.begin(), usual.end());
    }
  }
  return combinations(values);
}

std::vector<Group> candidates_of(const EffectInfo& info, std::size_t joint, const std::vector<Group>& members,
                                 const MotionScales& scales) {
  std::vector<Group> out;
  for (const std::vector<double>& shape : starts(info, members, scales)) {
    Group group;
    group.candidate = {std::string(info.name), joint, shape};
    group.nonlinear = static_cast<int>(info.refined_shapes().size());
    for (const ParameterInfo& p : info.linear) group.lower.push_back(p.lower);
    out.push_back(std::move(group));
  }
  return out;
}

}  // namespace

/// The choice of those groups and one of the candidates beside them, the best of all and refined; none is possible:
/// none.
std::optional<Choice> Search::with_best(const std::vector<std::size_t>& others, const std::vector<Group>& candidates) {
  const Choice without = evaluate(others);
  std::optional<Choice> best;
  const auto consider = [&](std::size_t g) {
    std::vector<std::size_t> groups = others;
    groups.push_back(g);
    Choice tried = evaluate(groups);
    const bool possible = tried.impossible <= without.impossible;
    if (possible && (!best || tried.score > best->score)) best = std::move(tried);
  };
  for (const Group& start : candidates) consider(problem_.add(start, problem_.make(start)));
  if (best) consider(refine(without, best->groups.back()));
  return best;
}

std::optional<Choice> Search::united(const Choice& choice, const EffectInfo& info, std::size_t joint) {
  std::vector<std::size_t> others;
  std::vector<Group> members;
  bool parts = false;
  for (const std::size_t g : choice.groups) {
    const Group& group = problem_.groups()[g];
    const bool here = !group.on_body && group.candidate.joint == joint;
    const bool part = here && is_united(info, group.candidate.effect);
    // The law itself, beside one of its parts, takes that part in.
    if (part || (here && group.candidate.effect == info.name)) {
      members.push_back(group);
    } else {
      others.push_back(g);
    }
    parts |= part;
  }
  if (!parts) return {};
  return with_best(others, candidates_of(info, joint, members, scales_of(problem_, joint)));
}

/// A law that explains no more than its parts, or with coefficients that it can't have, is those: where the joint may
/// have as many effects.
std::optional<Choice> Search::divided(const Choice& choice, const EffectInfo& info, std::size_t joint) {
  const auto is_here = [&](std::size_t g, std::string_view effect) {
    const Group& group = problem_.groups()[g];
    return !group.on_body && group.candidate.joint == joint && group.candidate.effect == effect;
  };
  const auto itself =
      std::find_if(choice.groups.begin(), choice.groups.end(), [&](std::size_t g) { return is_here(g, info.name); });
  if (itself == choice.groups.end()) return {};
  const std::vector<Group> law{problem_.groups()[*itself]};
  const double needed = threshold(*itself);
  std::vector<std::size_t> groups = choice.groups;
  std::erase(groups, *itself);
  std::optional<Choice> tried;
  for (const std::string_view part : info.unites) {
    // Parts of which one contains another are alternatives: the law took the place of either.
    if (!part.empty() && find_effect(part)->unites_others()) return {};
    if (part.empty() || std::any_of(groups.begin(), groups.end(), [&](std::size_t g) { return is_here(g, part); }))
      continue;
    tried = with_best(groups, candidates_of(*find_effect(part), joint, law, scales_of(problem_, joint)));
    if (!tried) return {};
    groups = tried->groups;
  }
  if (!tried) tried = evaluate(groups);  // the parts are all there
  const auto here = std::count_if(tried->groups.begin(), tried->groups.end(), [&](std::size_t g) {
    const Group& group = problem_.groups()[g];
    return !group.on_body && group.candidate.joint == joint;
  });
  if (static_cast<std::size_t>(here) > task_.settings.max_effects) return {};
  if (tried->impossible < choice.impossible) return tried;
  return tried->impossible == choice.impossible && tried->score + needed > choice.score ? tried : std::nullopt;
}

/// More shapes fit more of a log's own noise: every fold's judge has to be better off as well.
bool Search::is_better_held_out(const std::vector<std::size_t>& groups, const std::vector<std::size_t>& than,
                                std::size_t joint) const {
  const BlockSolver& solver = problem_.solver();
  const auto error = [&](const std::vector<std::size_t>& of, const Fold& fold) {
    return solver.square(solver.solve(problem_.columns_of(of), fold.fit), fold.judge)[static_cast<Eigen::Index>(joint)];
  };
  const std::vector<Fold>& folds = problem_.blocks().folds;
  return std::all_of(folds.begin(), folds.end(),
                     [&](const Fold& fold) { return error(groups, fold) < error(than, fold); });
}

/// The choice with what is not needed beside `kept` left out, least needed first.
Choice Search::pruned(Choice choice, std::size_t kept) const {
  while (choice.groups.size() > 1) {
    std::optional<Choice> best;
    for (const std::size_t g : choice.groups) {
      if (g == kept) continue;
      std::vector<std::size_t> others = choice.groups;
      std::erase(others, g);
      Choice without = evaluate(others);
      const bool needed = choice.possible() && choice.score - without.score >= threshold(g);
      if (!needed && without.possible() && (!best || without.score > best->score)) best = std::move(without);
    }
    if (!best) break;
    choice = std::move(*best);
  }
  return choice;
}

bool Search::trade(Choice& best) {
  if (best.groups.size() < 2) return false;
  std::set<std::string> tried;
  for (const Scored& one : score_all(best, false)) {
    const Group& group = problem_.groups()[one.group];
    if (!group.on_body || !tried.insert(group.candidate.effect).second) continue;
    std::vector<std::size_t> groups = best.groups;
    const std::size_t added = refine(best, one.group);
    groups.push_back(added);
    Choice choice = pruned(evaluate(groups), added);
    const bool shorter = choice.groups.size() <= best.groups.size();
    if (!choice.possible() || !shorter || choice.score <= best.score + options().swap_gain) continue;
    best = std::move(choice);
    return true;
  }
  return false;
}

Choice Search::unite(Choice best) {
  for (const EffectInfo& info : effect_infos()) {
    for (std::size_t j = 0; info.unites_others() && j < problem_.joints(); ++j) {
      const bool never = std::any_of(task_.never.begin(), task_.never.end(), [&](const EffectCandidate& one) {
        return one.effect == info.name && one.joint == j;
      });
      if (never) continue;
      // What the healthy session has already of that law is no finding, nor is it to be found twice.
      const std::vector<EffectFit>& known = problem_.log_columns().joint(j).effects;
      if (std::any_of(known.begin(), known.end(), [&](const EffectFit& fit) {
            return !fit.named && (fit.effect == info.name || is_united(info, fit.effect));
          }))
        continue;
      if (auto parts = divided(best, info, j)) best = std::move(*parts);
      std::optional<Choice> tried = united(best, info, j);
      // As any effect it has to bring more than noise does: it holds its parts as special cases.
      if (!tried || tried->score <= best.score + threshold(tried->groups.back())) continue;
      if (!is_better_held_out(tried->groups, best.groups, j)) continue;
      // What stood in for a part of it (a ripple, at reversals) is not needed any more.
      const std::size_t law = tried->groups.back();
      const double least = best.score + threshold(law);
      best = std::move(*tried);
      if (!best.possible()) continue;
      if (Choice less = pruned(best, law); less.score > least) best = std::move(less);
    }
  }
  return best;
}

}  // namespace fxdyn::diagnosis
