#include "host_tools/diagnose/explore.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "host_tools/diagnose/refit.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn::diagnosis {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// What can't be seen whatever its size: by joint, the robot's last.
std::vector<std::vector<std::string>> blind_spots(const Linearised& problem, const Search& search) {
  std::vector<std::vector<std::string>> out(problem.joints() + 1);
  for (const EffectInfo& info : effect_infos()) {
    for (std::size_t j = 0; j < problem.joints() + 1; ++j) {
      bool any = false, seen = false;
      for (std::size_t g = 0; g < search.not_absorbed().size() && g < problem.groups().size(); ++g) {
        const Group& group = problem.groups()[g];
        if (group.in_model || group.candidate.effect != info.name) continue;
        if (group.on_body != (j == problem.joints()) || (!group.on_body && group.candidate.joint != j)) continue;
        any = true;
        seen |= search.not_absorbed()[g] >= nothing_left;
      }
      if (any && !seen) out[j].emplace_back(info.name);
    }
  }
  return out;
}

/// Without a healthy session the noise's colour comes from a residual that holds the gap too: taken as noise, a slow
/// gap would be whitened away. So only where the residual is not much more than the noise above the torque's band.
std::vector<VectorXd> colours(const Models& models, const std::vector<SessionLog>& logs) {
  if (models.has_baseline) return {};
  const std::size_t n = joints_of(models.current).size();
  const std::vector<VectorXd> white(n, VectorXd::Zero(1));
  const Linearised in_band(models, logs, white), coloured(models, logs);
  std::vector<VectorXd> out = coloured.noise().whitening();
  for (std::size_t j = 0; j < n; ++j) {
    double noise = 0;
    for (const SessionLog& entry : logs) noise = std::max(noise, entry.log.torque_noise[static_cast<Index>(j)]);
    if (1 / std::sqrt(in_band.solver().weights()[static_cast<Index>(j)]) > models.options.noise.mostly_gap * noise)
      out[j] = white[j];
  }
  return out;
}

/// Friction that the healthy session has beside the nominal one: it may have changed, which is no second one of it.
/// What is held (Models::held) has changed by more than sessions differ: there the second one is the change.
std::vector<EffectCandidate> friction_of_background(const Models& models) {
  std::vector<EffectCandidate> out;
  for (std::size_t j = 0; j < joints_of(models.current).size(); ++j) {
    for (const EffectFit& fit : joints_of(models.current)[j].effects) {
      const EffectInfo& info = *find_effect(fit.effect);
      const bool held = std::any_of(models.held.begin(), models.held.end(), [&](const EffectCandidate& one) {
        return one.effect == fit.effect && one.joint == j;
      });
      if (!fit.named && !held && info.friction && !info.nominal && !info.several)
        out.push_back({fit.effect, j, fit.shape});
    }
  }
  return out;
}

/// The model follows the choice. What is appended first leaves the ids of the others as they are.
/// @returns ids of the choice's effects, in its order
std::vector<EffectId> follow(const Choice& choice, const Linearised& problem, Models& models) {
  std::vector<EffectId> ids;
  Index column = first_of_groups(problem, choice);
  for (const std::size_t g : choice.groups) {
    const Group& group = problem.groups()[g];
    ids.push_back(group.in_model ? group.id : name(models, group, choice.fit.x.segment(column, group.count)));
    column += group.count;
  }
  for (const std::size_t g : in_model(problem)) {
    if (std::find(choice.groups.begin(), choice.groups.end(), g) == choice.groups.end())
      ids.push_back(problem.groups()[g].id);
  }
  while (ids.size() > choice.groups.size()) {
    const EffectId gone = ids.back();
    ids.pop_back();
    take_back(models, ids, gone);
  }
  return ids;
}

/// A rotor that does not show is none. @returns whether there was one
bool forget_lost_rotors(Models& models, std::vector<EffectId>& ids) {
  bool lost = false;
  for (std::size_t j = 0; j < joints_of(models.current).size(); ++j) {
    const EffectFit* rotor = rotor_of(joints_of(models.current)[j]);
    if (rotor != nullptr && rotor->linear[0] <= 0) lost |= forget_rotor(models, ids, j);
  }
  return lost;
}

/// Searches around the models of an outcome, which become those of the choice. @returns whether that is another
bool explore_once(Outcome& out, const std::vector<SessionLog>& logs, const SearchTask& task, Progress& progress) {
  Models& models = out.models;
  out.put_down();
  auto with_candidates = std::make_unique<Linearised>(models, logs, out.whitening);
  Linearised& problem = *with_candidates;
  const std::vector<std::size_t> start = in_model(problem);
  std::vector<EffectCandidate> skip = task.never;
  for (const std::size_t g : start) skip.push_back(problem.groups()[g].candidate);
  std::erase_if(skip, [](const EffectCandidate& c) { return find_effect(c.effect)->several; });
  for (const EffectCandidate& has : friction_of_background(models)) skip.push_back(has);
  problem.add_all(dictionary(problem, skip));
  progress.step();
  Search search(problem, task);
  Choice choice = search.unite(search.run(start, progress));
  if (out.not_identifiable.empty()) out.not_identifiable = blind_spots(problem, search);
  const std::vector<Found> found = search.explain(choice);  // may take a rival
  std::vector<EffectId> ids = follow(choice, problem, models);
  out.dropped = std::any_of(start.begin(), start.end(), [&](std::size_t g) {
    return std::find(choice.groups.begin(), choice.groups.end(), g) == choice.groups.end();
  });
  const bool changed = out.dropped || ids.size() > start.size();
  const std::vector<VectorXd> whitening = problem.noise().whitening();
  with_candidates.reset();  // what follows linearises again, and its columns are the most that is ever held
  if (changed) refit(models, logs, whitening, 4);
  if (forget_lost_rotors(models, ids)) refit(models, logs, whitening, 2);
  out.found.clear();
  for (std::size_t i = 0; i < ids.size(); ++i)
    out.found.push_back({ids[i], found[i].score, found[i].alternatives, found[i].rival});
  // Without a baseline the gap was part of what looked like noise.
  out.whitening = changed && !models.has_baseline ? colours(models, logs) : whitening;
  out.look_again(logs);
  return changed;
}

void tell_stage(Progress& progress, bool first) {
  progress.stage(first ? "looking for what is missing" : "looking again, around what was found", 8);
}

Outcome around(Models models, std::vector<VectorXd> whitening) {
  Outcome out;
  out.models = std::move(models);
  out.whitening = std::move(whitening);
  return out;
}

}  // namespace

bool Outcome::structured() const {
  return std::any_of(lack.begin(), lack.end(),
                     [&](const LackOfFit& l) { return l.structured(models.options.lack_of_fit); });
}

bool Outcome::structured(std::size_t joint) const { return lack[joint].structured(models.options.lack_of_fit); }

void Outcome::put_down() {
  problem.reset();
  features.clear();
}

void Outcome::look_again(const std::vector<SessionLog>& logs) {
  put_down();  // before the next ones are made
  problem = std::make_unique<Linearised>(models, logs, whitening);
  whitening = problem->noise().whitening();
  features.resize(problem->joints());
  lack.resize(problem->joints());
  const std::vector<Index> columns = problem->columns_of(in_model(*problem));
  const LinearFit fit = problem->solver().solve(columns);
  std::optional<LinearFit> alone;
  if (models.has_baseline) alone = problem->solver().solve(columns, problem->blocks().fit_of(true));
  parallel_for(problem->joints(), [&](std::size_t j) {
    features[j] = diagnosis::features(*problem, j, models.has_baseline);
    lack[j] = lack_of_fit(*problem, j, fit, alone ? &*alone : nullptr, features[j]);
  });
  problem->forget_encoders();
}

Outcome explore(const Models& models, const std::vector<SessionLog>& logs, const SearchTask& task, int passes,
                Progress& progress) {
  Outcome out = around(models, colours(models, logs));
  for (int pass = 0; pass < passes; ++pass) {
    tell_stage(progress, pass == 0);
    const bool changed = explore_once(out, logs, task, progress);
    if (!changed || (!out.structured() && out.found.size() < 2)) break;
  }
  return out;
}

Outcome explore_rival(const Outcome& outcome, const Finding& finding, const std::vector<SessionLog>& logs,
                      const SearchTask& task, Progress& progress) {
  Outcome out = around(outcome.models, outcome.whitening);
  out.not_identifiable = outcome.not_identifiable;
  std::vector<EffectId> others;
  for (const Finding& found : outcome.found) {
    if (!(found.id == finding.id)) others.push_back(found.id);
  }
  // What is appended first leaves ids as they are, and a rotor that both have.
  name(out.models, finding.rival->group, finding.rival->coefficients);
  take_back(out.models, others, finding.id);
  refit(out.models, logs, outcome.whitening, 8);
  tell_stage(progress, false);
  explore_once(out, logs, task, progress);
  return out;
}

Outcome explore_again(const Outcome& outcome, const std::vector<SessionLog>& logs, const SearchTask& task,
                      Progress& progress) {
  Outcome out = around(outcome.models, outcome.whitening);
  out.not_identifiable = outcome.not_identifiable;
  tell_stage(progress, false);
  explore_once(out, logs, task, progress);
  return out;
}

}  // namespace fxdyn::diagnosis
