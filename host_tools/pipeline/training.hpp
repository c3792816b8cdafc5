#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/identify/estimate.hpp"
#include "host_tools/regression/metrics.hpp"
#include "host_tools/train/kept_effects.hpp"
#include "host_tools/train/search.hpp"
#include "host_tools/train/stored_information.hpp"
#include "host_tools/train/train.hpp"

namespace fxdyn {

/// Settings of [train] that the others leave without effect, and why; empty: none. Sparse features have windows of
/// nodes of their own, whatever searches.
std::string unused_settings(const TrainSettings& settings);

/// What training makes of a diagnosed model.
struct Training {
  IdentifiedModel model;
  /// Of the new fit, whether the model is it or not; but the bodies are those of the model.
  Estimate estimate;
  std::vector<TrainOutcome> outcomes;
  StoredInformation stored;
  StageErrors rigid, trained;
  std::vector<GateErrors> gate_errors;  ///< without those of the friction stage
};

/// A BLS beside the effects that diagnosis found. A joint has one in the end only where it lowers the joint's error on
/// the data that judge. There are two models: all is fitted together, or the base parameters stay, with everything of
/// the joints without a BLS, and each BLS is fitted beside them. The first is taken where it is better on the validate
/// logs, and on no joint without a BLS worse than the diagnosed model; without validate logs where all joints have one.
class Trainer {
 public:
  /// Errors of a model on all logs, under a stage's name.
  using ErrorsOf = std::function<StageErrors(const IdentifiedModel& model, const std::string& stage)>;

  /// Marks what saturation hides in the logs of `data`.
  Trainer(const Project& project, GateData& data, const IdentifiedModel& diagnosed, ErrorsOf errors,
          Progress& progress);

  /// `resume`: of a swarm that was interrupted.
  Training run(ResumeFile& resume);
  const Fitter& fitter() const { return fitter_; }

 private:
  Fitter make_fitter();
  /// The kept effects, and the load that a BLS sees, follow the rigid body that is fitted beside them.
  void follow(const IdentifiedModel& model);
  /// Everything together, with the BLS that the fitter has.
  void fit_anew(Training& out);
  /// Where the project wants a fit that diagnosis does not make: that one takes the diagnosed model's place.
  void choose_base(Training& out);
  /// A baseline taught the diagnosed model what the train logs alone may not: where validation says so, it stays.
  bool diagnosed_is_better(const StageErrors& refitted) const;
  std::vector<bool> joints_with_bls() const;
  /// Drops each BLS that does not lower the error of its joint.
  void settle(Training& out);
  /// Together, or beside the base's parameters.
  void choose_fit(Training& out);
  /// The base model with the BLS of some joints, and these joints' coefficients fitted beside its base parameters.
  void fit_beside(Training& out);
  void take_base(Training& out);
  /// On the validate logs, see above.
  bool together_is_better(const StageErrors& together, const StageErrors& beside) const;
  /// What of the new fit every model says: notes, and what a link encoder shows.
  void add_findings_of(const IdentifiedModel& refitted, IdentifiedModel& model) const;
  /// Joints whose BLS does not lower their error, on what judges. @param beside fitted beside the base's parameters
  std::vector<std::size_t> without_gain(Training& out, bool beside) const;
  /// The fitter's structure without any BLS.
  Fitter bare_fitter() const;
  void drop(Training& out, const std::vector<std::size_t>& joints);
  void finish(Training& out);
  std::vector<GateErrors> gate_errors(const Training& out) const;

  const Project& project_;
  const TrainSettings& settings_;
  GateData& data_;
  const IdentifiedModel& diagnosed_;
  ErrorsOf errors_;
  Progress& progress_;
  KeptEffects kept_;
  Fitter fitter_;
  IdentifiedModel base_;             ///< what a joint without a BLS has: the diagnosed model, or a fit after it
  std::vector<JointFit> base_fits_;  ///< .. as far as the fitter has columns for it
  bool base_is_diagnosed_ = true;
  bool together_ = false;  ///< the model is the fit of everything together
  std::optional<PhysicalFit> base_bodies_;
  StageErrors diagnosed_errors_, base_errors_;
  std::vector<JointFit> fits_;  ///< of the model, where it is not the new fit
};

/// The same structure without effects and BLS, refitted: its errors are the stage `rigid`.
StageErrors rigid_errors(Fitter fitter, const Project& project, const FilterFit& filter,
                         const Trainer::ErrorsOf& errors);

/// For MetricsResult.
std::vector<TrainedJoint> trained_joints(const std::vector<TrainOutcome>& outcomes, const Robot& robot);

}  // namespace fxdyn
