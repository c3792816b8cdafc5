#pragma once

#include <functional>
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
  Estimate estimate;  ///< of the new fit, whether the model is it or not
  std::vector<TrainOutcome> outcomes;
  StoredInformation stored;
  StageErrors rigid, trained;
};

/// A BLS beside the effects that diagnosis found.
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
  /// A baseline taught the diagnosed model what the train logs alone may not: where validation says so, it stays.
  void keep_diagnosed_if_better(Training& training);

  const Project& project_;
  const TrainSettings& settings_;
  GateData& data_;
  const IdentifiedModel& diagnosed_;
  ErrorsOf errors_;
  Progress& progress_;
  KeptEffects kept_;
  Fitter fitter_;
};

/// The same structure without effects and BLS, refitted: its errors are the stage `rigid`.
StageErrors rigid_errors(Fitter fitter, const Project& project, const FilterFit& filter,
                         const Trainer::ErrorsOf& errors);

/// For MetricsResult.
std::vector<TrainedJoint> trained_joints(const std::vector<TrainOutcome>& outcomes, const Robot& robot);

}  // namespace fxdyn
