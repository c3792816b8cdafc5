#include "host_tools/pipeline/possible_model.hpp"

#include "host_tools/identify/identify.hpp"
#include "host_tools/train/kept_effects.hpp"
#include "host_tools/train/stored_information.hpp"

namespace fxdyn {
namespace {

/// The model with base parameters and coefficients of another one of the same structure.
IdentifiedModel with_values_of(IdentifiedModel model, const IdentifiedModel& other) {
  for (std::size_t i = 0; i < model.base.size(); ++i) model.base[i].value = other.base[i].value;
  model.inertia = other.inertia;
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    for (std::size_t e = 0; e < model.joints[j].effects.size(); ++e)
      model.joints[j].effects[e].linear = other.joints[j].effects[e].linear;
  }
  return model;
}

}  // namespace

PossibleModel possible_model(const Project& project, const IdentifiedModel& model,
                             const std::vector<ProcessedLog>& logs) {
  const KeptEffects kept(model, logs);
  Fitter fitter(project.robot, logs, kept.design());
  fitter.set_torque_lead(model.filter.torque_lead_s, kept.torque(model, logs));
  weigh(fitter, project.identify);
  const NormalEquations equations = fitter.normal_equations();
  const Eigen::VectorXd x = coefficients_of(model, kept.design());
  const Solution own = fitter.split(x);
  const double variance = fitter.weighted_square(own) / fitter.train_rows();
  PhysicalFit bodies = fit_physical(fitter, project.robot, equations.information, equations.information * x, variance);
  if (!bodies.constrained) return {model, std::move(bodies)};
  IdentifiedModel possible = kept.restore(fitter.to_model(physical_solution(own, bodies)));
  return {with_values_of(model, possible), std::move(bodies)};
}

}  // namespace fxdyn
