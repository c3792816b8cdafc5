#include "host_tools/pipeline/training.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "host_tools/effects/broad_learning_types.hpp"
#include "host_tools/identify/identify.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {

/// Settings of [train] that the others leave without effect, and why; empty: none. Sparse features have windows of
/// nodes of their own, whatever searches.
std::string unused_settings(const TrainSettings& settings) {
  if (!settings.enabled) return {};
  const bool sparse = settings.features == "sparse", swarm = settings.pso.has_value();
  std::string names;
  const auto add = [&](bool unused, const char* key) {
    if (unused) names += (names.empty() ? "" : ", ") + std::string(key);
  };
  const bool sized = swarm || settings.enhancement;
  add(settings.windows && !sparse && (sized || !settings.nodes), "windows");
  add(settings.nodes && !sparse && sized, "nodes");
  add(settings.enhancement && swarm, "enhancement");
  add(settings.ridge && swarm, "ridge");
  if (names.empty()) return {};
  return fmt::format("train.{}: not used, {}", names,
                     swarm                  ? "the swarm of [train.pso] chooses within its bounds"
                     : settings.enhancement ? "enhancement says how many nodes there are"
                                            : "the number of nodes is searched; give nodes too to set it");
}

Trainer::Trainer(const Project& project, GateData& data, const IdentifiedModel& diagnosed, ErrorsOf errors,
                 Progress& progress)
    : project_(project),
      settings_(project.train),
      data_(data),
      diagnosed_(diagnosed),
      errors_(std::move(errors)),
      progress_(progress),
      kept_(diagnosed, data.logs),
      fitter_(make_fitter()) {}

Fitter Trainer::make_fitter() {
  kept_.mark_hidden(data_.logs);
  progress_.stage("building the regressor", 1);
  Fitter fitter(project_.robot, data_.logs, kept_.design());
  set_prior(fitter, project_);
  fitter.set_torque_lead(diagnosed_.filter.torque_lead_s);
  weigh(fitter, project_.identify);
  progress_.step();
  return fitter;
}

void Trainer::follow(const IdentifiedModel& model) {
  if (settings_.enabled && settings_.inputs == ExtendedInputs::name)
    fitter_.set_structural(structural_torque(model, data_.logs));
  fitter_.set_torque_lead(diagnosed_.filter.torque_lead_s, kept_.torque(model, data_.logs));
  weigh(fitter_, project_.identify);
}

Training Trainer::run(ResumeFile& resume) {
  Training out;
  out.rigid = rigid_errors(fitter_, project_, data_.filter, errors_);
  follow(diagnosed_);
  if (settings_.enabled) {
    // The model holds the hashes of project and logs: all that the outcome depends on.
    resume.identity = hash_of(to_json(diagnosed_).dump());
    // Where the model is the outcome already, a run was stopped between writing it and removing the search.
    if (settings_.pso && diagnosed_.stage == "trained") resume.drop_finished();
    out.outcomes = train(fitter_, settings_, progress_, resume);
  }
  progress_.stage("fit, standard deviations, possible bodies", 2);
  IdentifiedModel fitted = kept_.restore(fitter_.to_model(fitter_.estimate()));
  fitted.filter = diagnosed_.filter;
  follow(fitted);
  progress_.step();
  out.estimate = finish_model(fitter_, project_, data_);
  out.model = kept_.restore(out.estimate.model);
  progress_.step();
  progress_.stage("errors on all logs", 2);
  out.trained = errors_(out.model, "bls");
  out.stored = stored_information(fitter_);
  progress_.step();
  keep_diagnosed_if_better(out);
  out.model.stage = "trained";
  progress_.step();
  progress_.done();
  return out;
}

void Trainer::keep_diagnosed_if_better(Training& training) {
  IdentifiedModel before = diagnosed_;
  for (JointFit& joint : before.joints) joint.bls.reset();
  StageErrors unchanged = errors_(before, "bls");
  const auto& physical = training.estimate.physical;
  const bool possible = !physical || !physical->constrained;
  if (!possible || !(validation_error(unchanged) < validation_error(training.trained))) return;
  const std::string note = "training: the diagnosed model stays as it was, a new fit is worse on the validate logs";
  if (std::find(before.notes.begin(), before.notes.end(), note) == before.notes.end()) before.notes.push_back(note);
  data_.notes = before.notes;
  training.model = std::move(before);
  training.model.drop_tables();  // they are another model's now
  training.trained = std::move(unchanged);
  // The information of the train logs holds around what this model has from a baseline too.
  fitter_.set_designs(kept_.design());
  follow(training.model);
  training.stored = stored_information(fitter_);
  training.stored.information.recentre(coefficients_of(training.model, kept_.design()));
  for (TrainOutcome& outcome : training.outcomes) outcome.kept = false;
}

StageErrors rigid_errors(Fitter fitter, const Project& project, const FilterFit& filter,
                         const Trainer::ErrorsOf& errors) {
  for (std::size_t j = 0; j < fitter.joints(); ++j) {
    JointFit design = fitter.design(j);
    design.bls.reset();
    design.effects.clear();
    fitter.set_design(j, design);
  }
  weigh(fitter, project.identify);
  IdentifiedModel rigid = fitter.to_model(fitter.estimate());
  rigid.filter = filter;
  rigid.filter.torque_lead_s = fitter.torque_lead_s();
  return errors(rigid, "rigid");
}

std::vector<TrainedJoint> trained_joints(const std::vector<TrainOutcome>& outcomes, const Robot& robot) {
  std::vector<TrainedJoint> out;
  for (std::size_t j = 0; j < outcomes.size(); ++j) {
    const TrainOutcome& one = outcomes[j];
    out.push_back({robot.joints[j].name, robot.joints[j].torque_unit(), one.error_without, one.error_with, one.kept,
                   one.evaluations, choice_of(one)});
  }
  return out;
}

}  // namespace fxdyn
