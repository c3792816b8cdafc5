#include "host_tools/diagnose/diagnose.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "host_tools/diagnose/certainty.hpp"
#include "host_tools/diagnose/changes.hpp"
#include "host_tools/diagnose/deflection.hpp"
#include "host_tools/diagnose/deviations.hpp"
#include "host_tools/diagnose/free_curves.hpp"
#include "host_tools/diagnose/gate.hpp"
#include "host_tools/diagnose/harmless.hpp"
#include "host_tools/diagnose/healthy_session.hpp"
#include "host_tools/diagnose/left_curves.hpp"
#include "host_tools/diagnose/nominal_model.hpp"
#include "host_tools/diagnose/parked_columns.hpp"
#include "host_tools/diagnose/recording_faults.hpp"
#include "host_tools/diagnose/refit.hpp"
#include "host_tools/diagnose/sessions.hpp"
#include "host_tools/diagnose/verdict.hpp"
#include "host_tools/diagnose/windows.hpp"
#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/identified_model.hpp"
#include "host_tools/identify/estimate.hpp"
#include "host_tools/regression/regressor.hpp"
#include "host_tools/regression/solver.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/heap.hpp"
#include "host_tools/support/parallel.hpp"

namespace fxdyn {
namespace {

using namespace diagnosis;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// One diagnosis, step by step.
class Diagnoser {
 public:
  Diagnoser(const Project& project, GateData& data, const std::vector<ProcessedLog>& baseline,
            const std::vector<ProcessedLog>& test, const std::vector<bool>& still, Progress& progress,
            const Options& options, const FinishModel& finish)
      : project_(project),
        data_(data),
        baseline_(baseline),
        test_(test),
        still_(still),
        progress_(progress),
        finish_(finish) {
    models_.options = options;
    models_.has_baseline = !baseline_.empty();
    models_.smallest_step_s = project_.target.tick_s;
    for (const std::vector<ProcessedLog>* logs :
         {static_cast<const std::vector<ProcessedLog>*>(&data_.logs), &baseline_, &test_}) {
      for (const ProcessedLog& log : *logs) models_.smallest_step_s = std::min(models_.smallest_step_s, log.step_s);
    }
    task_.settings.max_effects = static_cast<std::size_t>(project_.diagnose.max_effects);
    // Few things change at once; a robot of which nothing is known may lack more.
    // A change beside a baseline is something or other; without one every joint may lack all that it is asked for.
    task_.settings.most = 4 + joints() * (models_.has_baseline ? 1 : task_.settings.max_effects);
    logs_ = sessions(data_.logs, baseline_, session_, options.session);
    if (std::vector<ProcessedLog> windows = windows_as_recorded(data_.logs, logs_, options.session); !windows.empty())
      windows_ = with_other_logs(data_, std::move(windows));
    add_notes(note_of_windows(logs_, options.session));
    for (std::size_t j = 0; j < joints(); ++j) {
      if (!still_[j]) continue;
      for (const std::string_view effect : joint_effect_names()) {
        if (!find_effect(effect)->curve) task_.never.push_back({std::string(effect), j, {}});
      }
    }
  }

  Diagnosis run() {
    check_lengths(logs_, options().session);
    note_who_judges();
    std::optional<ParkedColumns> parked;
    if (windows_) parked.emplace(data_.logs);  // nothing looks at the whole logs until all is settled
    if (models_.has_baseline) {
      learn_baseline();
    } else {
      models_.current = nominal();
      mute(logs_, models_.current, still_, options().session);
      look_at_links(models_.current, logs_);
    }
    models_.current->session = session_;
    models_.largest_load = largest_loads(models_, logs_);
    models_.least_width = least_widths(logs_);
    Diagnosis result;
    result.still = still_;
    // Of a baseline alone: what slipped since has bent nothing yet.
    const Models start = models_;
    // The model before: no effect that is to be found, its parameters the best without.
    Models before = models_;
    refit(before, logs_, plain(), 8);
    // What of the background is no longer what it was is a finding: it stays what it was, and the rest is looked for.
    models_.held = changed_effects(Linearised(before, logs_, plain()));
    if (!models_.held.empty()) {
      before = models_;
      refit(before, logs_, plain(), 8);
    }
    add_notes(check_judges(before.current, fitted().logs, still_, options().session));
    add_notes(check_judges(before.current, test_, still_, options().session));
    if (deflections_.found.empty()) {
      models_ = before;
    } else {
      for (const DeflectionEffect& effect : deflections_.found) {
        models_.current->joints[effect.joint].effects.push_back(effect.fit);
        add_rotor(models_, effect, options().prior.link_rotor);
      }
      refit(models_, logs_, plain(), 8);
    }
    add_deviations(before, Linearised(before, logs_));
    result.nominal = before.current;
    Gate gate;
    Outcome outcome = found_effects(start, gate);
    // What wanders may have got the name of an effect, and hides others.
    const Curves wandering = take_off_what_wanders(outcome, gate, still_, logs_);
    if (is_any(wandering)) search_without(start, outcome, gate);
    std::vector<Likely> likely;
    set_aside(outcome, gate, models_.current, logs_, still_, likely);
    result.nominal = finished(result.nominal);
    const IdentifiedModel judged_against = deflections_.found.empty() ? result.nominal : finished(models_.current);
    result.model = concluded(outcome, gate);
    // What came after the gate (likely names set aside, possible bodies) may have made a finding harm, or vanish.
    while (const std::optional<EffectId> harmful = harmful_finding(outcome, judged_against, result.model, logs_)) {
      if (!fit_without_harm(outcome, judged_against, logs_)) take_out(outcome, *harmful, logs_);
      gate = judge_again(outcome, logs_, still_);
      set_aside(outcome, gate, models_.current, logs_, still_, likely);
      result.model = concluded(outcome, gate);
    }
    if (models_.has_baseline) add_notes(changed_parameters(*outcome.problem));
    const Curves curves = curves_of_the_rest(outcome, gate, still_, wandering, logs_);
    doubt_beside_more(outcome, gate, curves, likely);
    mark_named(result.model, outcome);
    const std::vector<EffectId> judged = judged_by(gate, *outcome.problem);
    const std::vector<double> doubtful = doubtful_shares(*outcome.problem);
    if (windows_) {  // the whole logs come back: what was searched goes, which is as large
      outcome.put_down();
      for (SessionLog& log : logs_) log.cache = std::make_shared<RowCache>();
      parked->take_back();
    }
    const auto impacts = find_impacts(result.model, data_.logs, outcome.models.healthy, baseline_, options().impact);
    result.report = verdicts({result.nominal, result.model, outcome, gate, judged, doubtful, likely, deflections_,
                              impacts, curves, still_, data_.logs, test_});
    take_curves(outcome, result);
    clear_still_joints(result.model);
    clear_still_joints(result.nominal);
    add_notes(result.report.notes);
    result.report.notes = notes_;
    return result;
  }
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  /// What stands still has no friction that these logs show.
  void clear_still_joints(IdentifiedModel& model) const {
    for (std::size_t j = 0; j < joints(); ++j)
      if (still_[j]) model.joints[j].effects.clear();
  }
  Retrial retrial() const { return {models_.current, logs_, still_, task_}; }
  void note_who_judges() {
    const auto judges = [](const ProcessedLog& log) { return log.role == Role::validate; };
    if (data_.logs.size() > 1 && std::none_of(data_.logs.begin(), data_.logs.end(), judges)) {
      notes_.push_back("no log has role = \"validate\": names are accepted on the " + gate_of(data_.logs) +
                       "; other trajectories would judge better");
    }
  }
  IdentifiedModel finished(const IdentifiedModel& model) {
    const bool moves = std::find(still_.begin(), still_.end(), true) == still_.end();
    return finish_ && moves ? finish_(model, fitted().logs) : model;
  }
  /// The model of what passed the gate.
  IdentifiedModel concluded(Outcome& outcome, const Gate& gate) {
    Models& found = outcome.models;
    if (gate.groups.empty() && deflections_.found.empty()) {
      back_to_start(outcome, models_, logs_);
    } else if (outcome.structured()) {
      Models in_band = found;
      refit(in_band, logs_, plain(), 4);
      if (!is_worse_anywhere(found.current, in_band.current)) found = std::move(in_band);
      Linearised problem(found, logs_, plain());
      problem.solver().set_weights(diluted_weights(problem));
      add_deviations(found, problem);
    } else {
      add_deviations(found, *outcome.problem);
    }
    IdentifiedModel model = found.current;
    mark_named(model, outcome);
    return finished(model);
  }
  /// What the logs show beside the nominal model, and what the data that fitted nothing say of it.
  /// @param start for faults of the recordings
  Outcome found_effects(const Models& start, Gate& gate) {
    Outcome outcome = explore(models_, logs_, task_, 2, progress_);
    ParkedColumns parked(outcome.features);
    if (const auto fault = likely_recording_fault(start, logs_, outcome)) throw DataError(fault->complaint);
    parked.take_back();
    std::optional<Outcome> released = with_free_background(outcome, logs_);
    const std::vector<EffectCandidate> named = named_in(outcome);
    gate = pass(outcome, models_.current, logs_, still_);
    if (released) take_if_better(outcome, gate, std::move(*released), retrial());
    search_again(named, outcome, gate, retrial(), progress_);
    if (refit_links(outcome)) gate = pass(outcome, models_.current, logs_, still_);
    weigh_evidence(outcome, gate);
    if (settle_rivals(outcome, gate, retrial(), progress_) && refit_links(outcome)) {
      gate = pass(outcome, models_.current, logs_, still_);
      weigh_evidence(outcome, gate);
    }
    return outcome;
  }
  /// Again, on logs that have lost what wanders. Names of before stay only where the data that judge miss them.
  void search_without(const Models& start, Outcome& outcome, Gate& gate) {
    Outcome first = std::move(outcome);
    first.put_down();
    Deflections bent = deflections_;
    outcome = found_effects(start, gate);
    refit(first.models, logs_, first.whitening, 8);
    first.look_again(logs_);
    if (!take_if_better(outcome, gate, std::move(first), retrial())) return;
    deflections_ = std::move(bent);
    weigh_evidence(outcome, gate);
  }
  /// Squares of the error on what judges: validate logs by the model that is written, else logs by a fit of the others.
  VectorXd error_of(const Models& models, const IdentifiedModel& written) const {
    VectorXd out = plain_error(written, logs_);
    return out.size() > 0 ? out : judged_error(models, logs_);
  }
  /// The model has the curves that are told of, where the data that judge confirm them.
  void take_curves(const Outcome& outcome, Diagnosis& result) {
    if (task_.settings.max_effects == 0) return;  // the BLS is to learn what is left
    std::vector<JointDiagnosis>& told = result.report.joints;
    std::vector<bool> without = still_;
    for (std::size_t j = 0; j < joints(); ++j)
      without[j] = without[j] || !told[j].curve || !may_enter(*told[j].curve, logs_, options().gate);
    if (std::find(without.begin(), without.end(), false) == without.end()) return;
    Models bare = with_findings(outcome);
    refit(bare, logs_, plain(), 4);  // as those with curves are: the curves alone are to differ
    for (const VectorXd before = error_of(bare, result.model);;) {
      Models models = with_findings(outcome);
      const std::vector<FreeCurve> curves = add_free_curves(models, logs_, without);
      if (curves.empty()) return;
      Linearised problem(models, logs_, plain());
      problem.solver().set_weights(diluted_weights(problem));
      add_deviations(models, problem);
      IdentifiedModel with = models.current;
      mark_named(with, outcome);
      for (const FreeCurve& curve : curves) effect_of(with, curve.id).named = false;
      with = finished(with);
      const VectorXd after = error_of(models, with);
      // One that does not bring its joint's error down keeps no other out.
      bool all_fall = true;
      for (const FreeCurve& curve : curves) {
        const auto j = static_cast<Index>(curve.effect.joint);
        without[curve.effect.joint] = !(after[j] < before[j]);
        all_fall = all_fall && !without[curve.effect.joint];
      }
      if (!all_fall) continue;
      if (is_worse_anywhere(result.model, with)) return;
      result.model = std::move(with);
      for (const FreeCurve& curve : curves) told[curve.effect.joint].curve->in_model = true;
      return;
    }
  }
  std::size_t joints() const { return project_.robot.size(); }
  bool is_worse_anywhere(const IdentifiedModel& before, const IdentifiedModel& after) const {
    const std::vector<bool> harmed = harmed_joints(options().gate, before, after, logs_);
    return std::find(harmed.begin(), harmed.end(), true) != harmed.end();
  }
  const Options& options() const { return models_.options; }
  std::vector<VectorXd> plain() const { return std::vector<VectorXd>(joints(), VectorXd::Zero(1)); }
  void add_notes(const std::vector<std::string>& notes) { notes_.insert(notes_.end(), notes.begin(), notes.end()); }
  const std::string& name_of(std::size_t j) const { return project_.robot.joints[j].name; }

  /// The rotor that a link encoder separates from the link.
  /// @param share standard deviation of what is known of it, of itself
  static void add_rotor(Models& models, const DeflectionEffect& effect, double share) {
    if (effect.rotor <= 0 || rotor_of(models.current->joints[effect.joint]) != nullptr) return;
    const IdentifiedModel& model = models.current;
    Rotor rotor{effect.joint, rotor_in_base(to_dh(model.robot), base_set_of(model), static_cast<Index>(effect.joint)),
                effect.rotor, share * effect.rotor};
    bring_rotor(models, rotor, effect.rotor);
  }

  /// A link encoder shows what bends before any torque is looked at.
  void look_at_links(const IdentifiedModel& model, const std::vector<SessionLog>& fitted) {
    const auto linked = [](const ProcessedLog& log) { return log.qlink.size() > 0; };
    if (std::none_of(data_.logs.begin(), data_.logs.end(), linked)) return;
    MatrixXd covariance;
    {
      Models alone;
      alone.current = model;
      alone.options = options();
      std::vector<SessionLog> logs;
      for (const SessionLog& log : fitted) {
        if (!log.fits) continue;
        logs.push_back(log);
        logs.back().healthy = false;
      }
      covariance = base_covariance(Linearised(alone, logs));
    }
    std::vector<DeflectionEffect> already;
    deflections_ = find_deflections(model, covariance, data_.logs, baseline_, already, options().deflection);
    if (!baseline_.empty() && std::none_of(baseline_.begin(), baseline_.end(), linked) && !deflections_.found.empty())
      notes_.push_back("the baseline has no qlink columns: what the link encoders show may have been there before");
    std::vector<bool> judged(joints(), false);
    const auto fix = [&](const DeflectionEffect& effect) {
      models_.fixed.push_back({effect.fit.effect, effect.joint, effect.fit.shape});
      judged[effect.joint] = true;
    };
    for (const DeflectionEffect& effect : already) {
      notes_.push_back(fmt::format("{}: the baseline has {} already", name_of(effect.joint), effect.fit.effect));
      fix(effect);
      bent_already_.push_back(effect);
    }
    for (const DeflectionEffect& effect : deflections_.found) fix(effect);
    for (std::size_t j = 0; j < joints(); ++j) {
      const bool encoded = std::all_of(data_.logs.begin(), data_.logs.end(),
                                       [&](const ProcessedLog& log) { return linked(log) && log.has_link[j]; });
      if (!encoded && !judged[j]) continue;
      for (const EffectInfo& info : effect_infos()) {
        if (info.acts_on == ActsOn::position) task_.never.push_back({std::string(info.name), j, {}});
      }
    }
  }

  /// The links' deflection was fitted by the load of a model that did not know what else was missing (friction that it
  /// lacks bends its inertias): again, by the load of the one that does. What comes out as another set of effects, or
  /// closes less on the data that judge, stays as it was.
  bool refit_links(Outcome& outcome) {
    if (deflections_.found.empty() || outcome.found.empty()) return false;
    // Which part of the inertia is the rotor's is found anew where the deflection separates it.
    const auto without_rotors = [&](Models models, const Deflections& seen, std::vector<EffectId>& ids) {
      for (const DeflectionEffect& effect : seen.found) {
        if (effect.rotor > 0) forget_rotor(models, ids, effect.joint);
      }
      return models;
    };
    std::vector<EffectId> ids;
    for (const Finding& finding : outcome.found) ids.push_back(finding.id);
    std::vector<EffectId> unused = ids;
    const Models asked = without_rotors(outcome.models, deflections_, unused);
    std::vector<DeflectionEffect> already;
    const Deflections again = find_deflections(asked.current, base_covariance(Linearised(asked, logs_)), data_.logs,
                                               baseline_, already, options().deflection);
    auto [taken, kept] = take_where_better(deflections_, again, joints(), options().deflection);
    if (taken.found.empty()) return false;
    Deflections replaced;  // where the old rotor goes
    for (const DeflectionEffect& effect : deflections_.found) {
      if (!at_joint(taken, effect.joint).empty()) replaced.found.push_back(effect);
    }
    Models models = without_rotors(outcome.models, replaced, ids);
    for (const DeflectionEffect& effect : taken.found) {
      for (EffectFit& fit : models.current->joints[effect.joint].effects) {
        if (fit.effect == effect.fit.effect) fit = effect.fit;
      }
      for (EffectCandidate& fixed : models.fixed) {
        if (fixed.effect == effect.fit.effect && fixed.joint == effect.joint) fixed.shape = effect.fit.shape;
      }
      add_rotor(models, effect, options().prior.refitted_rotor);
    }
    kept.found.insert(kept.found.end(), taken.found.begin(), taken.found.end());
    deflections_.found = kept.found;
    outcome.models = std::move(models);
    for (std::size_t i = 0; i < ids.size(); ++i) outcome.found[i].id = ids[i];
    refit(outcome.models, logs_, outcome.whitening, 4);
    outcome.look_again(logs_);
    return true;
  }

  /// Without a baseline. It is fitted again on what is searched, so that of long logs it needs no more.
  IdentifiedModel nominal() {
    IdentifiedModel out = nominal_model(project_, fitted(), false, progress_);
    if (windows_) data_.notes.insert(data_.notes.end(), windows_->notes.begin(), windows_->notes.end());
    give_back_memory();
    return out;
  }
  /// Train and validate logs at the rate of the fit, of long ones windows.
  GateData& fitted() { return windows_ ? *windows_ : data_; }

  /// @throws DataError that names the baseline
  IdentifiedModel healthy_model(const Project& project, GateData& healthy) const {
    try {
      IdentifiedModel model = nominal_model(project, healthy, true, progress_);
      model.logs = data_.references;
      return model;
    } catch (const DataError& error) {
      throw DataError(fmt::format("role = \"baseline\": {}", error.what()));
    }
  }
  /// With what bends already: the healthy session alone.
  Models bent(IdentifiedModel model, const std::vector<SessionLog>& logs) const {
    Models out;
    for (const DeflectionEffect& effect : bent_already_) {
      model.joints[effect.joint].effects.push_back(effect.fit);
      model.joints[effect.joint].effects.back().named = false;
    }
    out.current = std::move(model);
    out.fixed = models_.fixed;
    out.options = options();
    out.smallest_step_s = models_.smallest_step_s;
    for (const DeflectionEffect& effect : bent_already_) add_rotor(out, effect, options().prior.link_rotor);
    out.largest_load = largest_loads(out, logs);
    out.least_width = least_widths(logs);
    return out;
  }

  /// What the healthy session has that is not nominal is its background: learned, not reported.
  void learn_baseline() {
    GateData healthy = with_other_logs(data_, baseline_);
    models_.healthy = healthy_model(project_, healthy);
    mute(logs_, models_.healthy, still_, options().session);
    std::vector<SessionLog> before;
    for (const SessionLog& log : logs_) {
      if (!log.healthy) continue;
      before.push_back(log);
      before.back().healthy = false;
    }
    look_at_links(models_.healthy, before);
    HealthySession learned = learn_healthy(bent(models_.healthy, before), before, task_, progress_);
    const double lead = models_.healthy->filter.torque_lead_s;
    if (lead != 0 && !project_.signals.torque_lead_s) {
      // Friction with memory looks like a torque column of other times until it is in the model.
      Project aligned = project_;
      aligned.signals.torque_lead_s = 0;
      GateData again = healthy;
      HealthySession other = learn_healthy(bent(healthy_model(aligned, again), before), before, task_, progress_);
      if (!errs_less(learned, other)) {
        learned = std::move(other);
        std::erase(healthy.notes, torque_lead_note(lead));
      }
    }
    for (const EffectCandidate& effect : learned.effects)
      notes_.push_back(fmt::format("{}: the baseline has {} already", name_of(effect.joint), effect.effect));
    for (const std::size_t j : learned.structured)
      notes_.push_back(fmt::format("{}: the baseline has structure that no effect explains", name_of(j)));
    models_.background = std::move(learned.structured);
    models_.healthy = models_.current = learned.models.current;
    models_.rotors = learned.models.rotors;
    add_notes(check_same_robot(models_, logs_, still_));
    data_.notes.insert(data_.notes.end(), healthy.notes.begin(), healthy.notes.end());
  }

  const Project& project_;
  GateData& data_;
  const std::vector<ProcessedLog>& baseline_;
  const std::vector<ProcessedLog>& test_;
  const std::vector<bool>& still_;
  Progress& progress_;
  const FinishModel& finish_;
  Models models_;
  SearchTask task_;
  std::optional<Session> session_;
  std::vector<SessionLog> logs_;
  std::optional<GateData> windows_;  ///< of train and validate logs that are not searched whole; none: all are
  Deflections deflections_;
  std::vector<DeflectionEffect> bent_already_;
  std::vector<std::string> notes_;
};

}  // namespace

Diagnosis diagnose(const Project& project, GateData& given, const std::vector<ProcessedLog>& given_baseline,
                   const std::vector<ProcessedLog>& test, Progress& progress, const Options& options,
                   const FinishModel& finish) {
  const std::vector<bool> still = still_joints(given, options.session);
  if (std::find(still.begin(), still.end(), false) == still.end()) {
    throw DataError(
        "not_excited: no joint moves in the train logs by more than its encoder's noise; record logs in which they do");
  }
  check_baseline_moves(project.robot, given, given_baseline);
  // Logs may fill the memory: a copy only where a joint of them is left out.
  const bool changes = std::find(still.begin(), still.end(), true) != still.end();
  GateData changed;
  std::vector<ProcessedLog> changed_baseline;
  if (changes) {
    changed = given;
    changed_baseline = given_baseline;
    leave_out(changed.logs, still);
    leave_out(changed_baseline, still);
  }
  GateData& data = changes ? changed : given;
  const std::vector<ProcessedLog>& baseline = changes ? changed_baseline : given_baseline;
  Diagnoser diagnoser(project, data, baseline, test, still, progress, options, finish);
  Diagnosis result = diagnoser.run();
  if (changes) given.notes = changed.notes;
  given.notes.insert(given.notes.end(), diagnoser.notes().begin(), diagnoser.notes().end());
  progress.done();
  return result;
}

}  // namespace fxdyn
