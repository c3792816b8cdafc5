#include "host_tools/diagnose/without.hpp"

#include "host_tools/diagnose/models.hpp"
#include "host_tools/diagnose/refit.hpp"
#include "host_tools/effects/effects.hpp"

namespace fxdyn::diagnosis {

bool works_on_others(const Group& group) {
  const EffectInfo& info = *find_effect(group.candidate.effect);
  return info.acts_on != ActsOn::torque || info.needs_structural || info.needs_total;
}

std::unique_ptr<Linearised> without(const Linearised& problem, const std::vector<std::size_t>& groups) {
  Models models = problem.models();
  std::vector<EffectId> ids;
  ids.reserve(groups.size());
  for (const std::size_t g : groups) ids.push_back(problem.groups()[g].id);
  while (!ids.empty()) {
    const EffectId gone = ids.back();
    ids.pop_back();
    take_back(models, ids, gone);
  }
  auto out = std::make_unique<Linearised>(models, problem.logs(), problem.noise().whitening());
  out->solver().set_weights(problem.solver().weights());
  return out;
}

}  // namespace fxdyn::diagnosis
