#include "host_tools/pipeline/training.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "host_tools/effects/broad_learning_types.hpp"
#include "host_tools/identify/identify.hpp"
#include "host_tools/pipeline/possible_model.hpp"
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
  diagnosed_errors_ = errors_(diagnosed_, "diagnosed");
  choose_base(out);
  if (settings_.enabled) {
    // The model holds the hashes of project and logs: all that the outcome depends on.
    resume.identity = hash_of(to_json(diagnosed_).dump());
    // Where the model is the outcome already, a run was stopped between writing it and removing the search.
    if (settings_.pso && diagnosed_.stage == "trained") resume.drop_finished();
    out.outcomes = train(fitter_, settings_, progress_, resume);
  }
  progress_.stage("fit, standard deviations, possible bodies", 2);
  settle(out);
  progress_.step();
  finish(out);
  progress_.step();
  progress_.done();
  return out;
}

void Trainer::fit_anew(Training& out) {
  IdentifiedModel fitted = kept_.restore(fitter_.to_model(fitter_.estimate()));
  fitted.filter = diagnosed_.filter;
  follow(fitted);
  out.estimate = finish_model(fitter_, project_, data_);
  out.model = kept_.restore(out.estimate.model);
}

void Trainer::choose_base(Training& out) {
  follow(diagnosed_);
  base_ = diagnosed_;
  for (JointFit& joint : base_.joints) joint.bls.reset();
  base_fits_ = kept_.design();
  base_errors_ = diagnosed_errors_;
  const IdentifySettings& asked = project_.identify;
  const bool other_fit = asked.essential || asked.prior_error || asked.method == "irls" || asked.method == "rls";
  if (settings_.enabled && !other_fit) {
    if (asked.physical) base_bodies_ = possible_model(project_, base_, data_.logs).bodies;
    return;
  }
  fitter_.polish();  // shapes as well: what a prior knows of the bodies moves them, too
  fit_anew(out);
  const StageErrors refitted = errors_(out.model, "bls");
  if (diagnosed_is_better(refitted)) {
    const std::string note = "training: the diagnosed model stays as it was, a new fit is worse on the validate logs";
    if (std::find(data_.notes.begin(), data_.notes.end(), note) == data_.notes.end()) data_.notes.push_back(note);
    if (asked.physical) base_bodies_ = possible_model(project_, base_, data_.logs).bodies;
    fitter_.set_designs(kept_.design());
    follow(diagnosed_);
    return;
  }
  base_ = out.model;
  base_is_diagnosed_ = false;
  base_errors_ = refitted;
  base_bodies_ = out.estimate.physical;
  for (std::size_t j = 0; j < base_fits_.size(); ++j) {
    const std::size_t columns = base_fits_[j].effects.size();
    base_fits_[j] = out.estimate.model.joints[j];
    base_fits_[j].effects.resize(columns);  // what a link encoder gave is behind them
  }
}

bool Trainer::diagnosed_is_better(const StageErrors& refitted) const {
  return validation_error(diagnosed_errors_) < validation_error(refitted);
}

std::vector<bool> Trainer::joints_with_bls() const {
  std::vector<bool> out;
  for (std::size_t j = 0; j < fitter_.joints(); ++j) out.push_back(fitter_.design(j).bls.has_value());
  return out;
}

void Trainer::settle(Training& out) {
  const auto all = [](const std::vector<bool>& these, bool value) {
    return std::find(these.begin(), these.end(), !value) == these.end();
  };
  std::vector<bool> with = joints_with_bls();
  // Where there is no BLS, choose_base() has made this fit if anybody wanted it.
  if (!all(with, false) || out.model.base.empty()) fit_anew(out);
  while (!all(with, false)) {
    if (!fitter_.has_validation() && all(with, true)) {
      together_ = true;  // blocks of train logs do not judge what was fitted to all of them
    } else {
      choose_fit(out);
    }
    out.trained = errors_(out.model, "bls");
    const std::vector<std::size_t> gone = without_gain(out, !together_);
    if (gone.empty()) return;
    drop(out, gone);
    with = joints_with_bls();
  }
  together_ = false;
  take_base(out);
}

void Trainer::choose_fit(Training& out) {
  fit_anew(out);
  const IdentifiedModel together = out.model;
  const StageErrors errors = errors_(together, "bls");
  fit_beside(out);
  together_ = together_is_better(errors, errors_(out.model, "bls"));
  if (!together_) return;
  out.model = together;
  follow(together);
}

bool Trainer::together_is_better(const StageErrors& together, const StageErrors& beside) const {
  if (!fitter_.has_validation()) return false;
  for (std::size_t j = 0; j < fitter_.joints(); ++j) {
    if (fitter_.design(j).bls) continue;
    if (pooled_error(together.logs, Role::validate, j).rmse > pooled_error(base_errors_.logs, Role::validate, j).rmse)
      return false;
  }
  return validation_error(together) < validation_error(beside);
}

void Trainer::drop(Training& out, const std::vector<std::size_t>& joints) {
  std::string names;
  for (const std::size_t j : joints) {
    JointFit design = fitter_.design(j);
    design.bls.reset();
    fitter_.set_design(j, std::move(design));
    out.outcomes[j].kept = false;
    names += (names.empty() ? "" : ", ") + project_.robot.joints[j].name;
  }
  data_.notes.push_back(
      fmt::format("training: no BLS on {}: fitted with the whole model it does not lower the error there", names));
}

void Trainer::add_findings_of(const IdentifiedModel& refitted, IdentifiedModel& model) const {
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const JointFit& from = refitted.joints[j];
    JointFit& to = model.joints[j];
    to.flexible = from.flexible;
    for (std::size_t e = to.effects.size(); e < from.effects.size(); ++e) to.effects.push_back(from.effects[e]);
  }
  model.notes = data_.notes;
  for (const std::string& note : refitted.notes) {
    if (std::find(model.notes.begin(), model.notes.end(), note) == model.notes.end()) model.notes.push_back(note);
  }
  model.drop_tables();  // they are another model's now
}

void Trainer::fit_beside(Training& out) {
  const IdentifiedModel refitted = kept_.restore(out.estimate.model);
  follow(base_);
  const Eigen::VectorXd beta = coefficients_of(base_, {});
  const IdentifiedModel fitted = fitter_.to_model(fitter_.estimate_beside(beta, project_.identify.physical));
  const IdentifiedModel restored = kept_.restore(fitted);
  out.model = base_;
  add_findings_of(refitted, out.model);
  fits_ = base_fits_;
  for (std::size_t j = 0; j < fits_.size(); ++j) {
    if (!fitter_.design(j).bls) continue;
    fits_[j] = fitted.joints[j];
    JointFit& joint = out.model.joints[j];
    // Standard deviations are those of the fit of everything together: beside known base parameters they look smaller.
    for (std::size_t e = 0; e < restored.joints[j].effects.size(); ++e) {
      joint.effects[e] = refitted.joints[j].effects[e];
      joint.effects[e].linear = restored.joints[j].effects[e].linear;
    }
    joint.bls = restored.joints[j].bls;
  }
}

void Trainer::take_base(Training& out) {
  const IdentifiedModel refitted = kept_.restore(out.estimate.model);
  out.model = base_;
  add_findings_of(refitted, out.model);
  out.trained = base_errors_;
  out.trained.stage = "bls";
  fits_ = base_fits_;
}

Fitter Trainer::bare_fitter() const {
  Fitter bare = fitter_;
  std::vector<JointFit> designs;
  for (std::size_t j = 0; j < bare.joints(); ++j) {
    designs.push_back(bare.design(j));
    designs.back().bls.reset();
  }
  bare.set_designs(std::move(designs));
  return bare;
}

std::vector<std::size_t> Trainer::without_gain(Training& out, bool beside) const {
  const TrainOptions options;
  const Fitter bare = bare_fitter();
  const Eigen::VectorXd beta = coefficients_of(base_, {});
  const std::vector<Judgement> with = beside ? fitter_.held_out_beside(beta) : fitter_.held_out();
  const std::vector<Judgement> without = beside ? bare.held_out_beside(beta) : bare.held_out();
  std::vector<std::size_t> gone;
  for (std::size_t j = 0; j < with.size(); ++j) {
    if (!fitter_.design(j).bls) continue;
    const double before = pooled_error(base_errors_.logs, Role::validate, j).rmse;
    const double after = pooled_error(out.trained.logs, Role::validate, j).rmse;
    const bool lower = !fitter_.has_validation() || after < before;
    if (lower && with[j].beats(without[j], options.worth_keeping)) continue;
    gone.push_back(j);
    // Reported: the comparison that it failed.
    out.outcomes[j].error_without = lower ? without[j].rmse : before;
    out.outcomes[j].error_with = lower ? with[j].rmse : after;
  }
  return gone;
}

void Trainer::finish(Training& out) {
  out.gate_errors = gate_errors(out);
  if (!together_) {
    if (base_bodies_ && out.estimate.physical) base_bodies_->constrained = out.estimate.physical->constrained;
    out.estimate.physical = base_bodies_;
    // The information of the train logs holds around what this model has from elsewhere too.
    follow(out.model);
  }
  out.stored = stored_information(fitter_);
  if (!together_) out.stored.information.recentre(coefficients_of(out.model, fits_));
  out.model.stage = "trained";
}

std::vector<GateErrors> Trainer::gate_errors(const Training& out) const {
  const bool validated = fitter_.has_validation();
  std::vector<Judgement> with, without;
  if (!validated) {
    with = fitter_.held_out();
    without = bare_fitter().held_out();
  }
  std::vector<GateErrors> errors;
  for (std::size_t j = 0; j < fitter_.joints(); ++j) {
    const Joint& joint = project_.robot.joints[j];
    const bool bls = fitter_.design(j).bls.has_value();
    GateErrors one{
        joint.name, joint.torque_unit(), {}, 0, 0, bls || together_ || !base_is_diagnosed_ ? "bls" : "diagnosed"};
    one.diagnosed = validated ? pooled_error(diagnosed_errors_.logs, Role::validate, j).rmse : without[j].rmse;
    one.bls =
        validated ? pooled_error(out.trained.logs, Role::validate, j).rmse : (bls ? with[j].rmse : without[j].rmse);
    errors.push_back(std::move(one));
  }
  return errors;
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
