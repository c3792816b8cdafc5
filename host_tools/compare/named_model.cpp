#include "host_tools/compare/named_model.hpp"

#include "host_tools/diagnose/diagnose.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/identify/estimate.hpp"
#include "host_tools/identify/identify.hpp"
#include "host_tools/identify/structure.hpp"
#include "host_tools/pipeline/possible_model.hpp"
#include "host_tools/pipeline/training.hpp"

namespace fxdyn {
namespace {

IdentifiedModel diagnosed_and_fitted(const Project& project, GateData data, bool with_bls, Progress& progress) {
  FinishModel finish;
  if (project.identify.physical) {
    finish = [&](const IdentifiedModel& model, const std::vector<ProcessedLog>& logs) {
      return possible_model(project, model, logs).model;
    };
  }
  const IdentifiedModel diagnosed = diagnose(project, data, {}, {}, progress, {}, finish).model;
  // Diagnosis searches without a prior; the fit after it, that of `train`, has one.
  Project fitted = project;
  fitted.train.enabled = with_bls;
  const auto errors = [&](const IdentifiedModel& model, const std::string& name) {
    StageErrors out{name, {}};
    for (const ProcessedLog& log : data.logs) out.logs.push_back(errors_of(log, model.robot, predict(model, log)));
    return out;
  };
  ResumeFile nothing;
  return Trainer(fitted, data, diagnosed, errors, progress).run(nothing).model;
}

}  // namespace

IdentifiedModel named_model(const Project& project, GateData data, Progress& progress) {
  return diagnosed_and_fitted(project, std::move(data), false, progress);
}

IdentifiedModel named_and_trained_model(const Project& project, GateData data, Progress& progress) {
  return diagnosed_and_fitted(project, std::move(data), true, progress);
}

IdentifiedModel lugre_of_possible_bodies(const Project& project, GateData data, Progress& progress) {
  Project bodies = with_structure(project, lugre_friction, "wls");
  bodies.identify.physical = true;
  const auto fitter = identify(bodies, data, progress);
  return finish_model(*fitter, bodies, data).model;
}

}  // namespace fxdyn
