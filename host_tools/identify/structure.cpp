#include "host_tools/identify/structure.hpp"

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/identify/estimate.hpp"

namespace fxdyn {

Project with_structure(Project project, const std::vector<std::string>& effects, const std::string& method) {
  project.identify.effects = effects;
  project.identify.method = method;
  project.identify.physical = false;
  project.identify.essential = false;
  return project;
}

IdentifiedModel identify_structure(const Project& project, GateData data, const std::vector<std::string>& effects,
                                   const std::string& method, Progress& progress) {
  const Project reduced = with_structure(project, effects, method);
  const auto fitter = identify(reduced, data, progress);
  const Estimate estimate = finish_model(*fitter, reduced, data);
  if (!estimate.recursion) return estimate.model;
  IdentifiedModel recursive = fitter->to_model(estimate.recursion->solution);
  recursive.filter = estimate.model.filter;
  recursive.tick_s = estimate.model.tick_s;
  return recursive;
}

IdentifiedModel rigid_part(IdentifiedModel model) {
  for (JointFit& joint : model.joints) {
    joint.bls.reset();
    std::erase_if(joint.effects, [](const EffectFit& fit) { return !in_base(fit.effect); });
  }
  return model;
}

}  // namespace fxdyn
