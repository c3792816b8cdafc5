#pragma once

#include "host_tools/effects/identified_model.hpp"
#include "host_tools/regression/dataset.hpp"
#include "host_tools/train/options.hpp"

namespace fxdyn {

/// What diagnosis found and the Fitter has no columns for: effects on position or body, those that need the structural
/// or the total torque, a rotor that only the load's friction separates from the link, drift in a session that was warm
/// when a log began, free curves, and what a healthy session had of an effect that grew. They stay as they are while
/// everything else is fitted again.
class KeptEffects {
 public:
  /// @param logs on which is fitted
  /// @param keep_drift drift stays as it is, as it does where a log begins warm
  KeptEffects(IdentifiedModel diagnosed, const std::vector<ProcessedLog>& logs, bool keep_drift = false);

  /// What the Fitter fits, without the kept effects.
  const std::vector<JointFit>& design() const { return design_; }
  /// The model that was fitted with the kept effects in their places. Standard deviations that the Fitter does not
  /// estimate (of wavenumbers, ..) stay what they were.
  IdentifiedModel restore(IdentifiedModel fitted) const;
  /// The torque of the logs as design() has to explain it, filtered (Fitter::set_torque_lead()), if `model`, with kept
  /// effects, is true: those that act on the total torque are undone, the others' torque is subtracted. It follows the
  /// model's rigid body: exact where the fit ends at `model`, else off by the kept effects' share of the difference.
  std::vector<Eigen::MatrixXd> torque(const IdentifiedModel& model, const std::vector<ProcessedLog>& logs) const;
  /// Marks the samples as saturated at which a named saturation hides what the total was: before the Fitter is made.
  void mark_hidden(std::vector<ProcessedLog>& logs, const KeptOptions& options = {}) const;

 private:
  bool is_kept(std::size_t joint, const EffectFit& fit) const;

  IdentifiedModel diagnosed_;
  std::vector<bool> rotor_is_absorbed_;  ///< per joint
  bool warm_ = false;
  std::vector<JointFit> design_;
};

}  // namespace fxdyn
