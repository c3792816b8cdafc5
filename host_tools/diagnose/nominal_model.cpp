#include "host_tools/diagnose/nominal_model.hpp"

#include <utility>

#include "host_tools/effects/effects.hpp"
#include "host_tools/identify/estimate.hpp"

namespace fxdyn::diagnosis {
namespace {

/// Friction with memory that a model lacks looks like a torque that is not aligned: by how much it is beside the
/// effects that `identify` adds by itself [s].
double lead_beside_effects(Project project, GateData& data, Progress& progress) {
  std::vector<std::string> notes = data.notes;  // what is found on the way is no finding
  project.identify.effects.reset();
  const double lead = identify(project, data, progress)->torque_lead_s();
  data.notes = std::move(notes);
  return lead;
}

}  // namespace

GateData with_other_logs(const GateData& data, std::vector<ProcessedLog> logs) {
  GateData out;
  out.filter = data.filter;
  out.logs = std::move(logs);
  out.references = data.references;
  out.largest_torque = data.largest_torque;
  out.q_lower = data.q_lower;
  out.q_upper = data.q_upper;
  out.dq = data.dq;
  out.ddq = data.ddq;
  out.threads = data.threads;
  return out;
}

IdentifiedModel nominal_model(Project project, GateData& data, bool healthy, Progress& progress) {
  if (!project.identify.effects) project.identify.effects = nominal_effects();
  project.identify.physical = false;
  project.identify.essential = false;
  if (project.identify.method == "rls") project.identify.method = "wls";
  const auto fitter = identify(project, data, progress);
  if (fitter->torque_lead_s() != 0 && !project.signals.torque_lead_s) {
    const double lead = lead_beside_effects(project, data, progress);
    std::erase(data.notes, torque_lead_note(fitter->torque_lead_s()));
    if (lead != 0) data.notes.push_back(torque_lead_note(lead));
    fitter->set_torque_lead(lead);
    weigh(*fitter, project.identify);
  }
  if (fitter->torque_lead_s() < 0 && !project.signals.torque_lead_s && !healthy) {
    // Torque that comes late is an effect with a name; but for a healthy robot it is how its signals are sampled.
    std::erase(data.notes, torque_lead_note(fitter->torque_lead_s()));
    fitter->set_torque_lead(0);
    weigh(*fitter, project.identify);
  }
  IdentifiedModel model = finish_model(*fitter, project, data).model;
  // What bends is found here, with its rivals.
  for (JointFit& joint : model.joints) {
    std::erase_if(joint.effects,
                  [](const EffectFit& fit) { return find_effect(fit.effect)->acts_on == ActsOn::position; });
    joint.flexible.reset();
  }
  return model;
}

}  // namespace fxdyn::diagnosis
