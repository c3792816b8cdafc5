#pragma once

#include <optional>
#include <vector>

#include "host_tools/diagnose/finding.hpp"
#include "host_tools/diagnose/own_evidence.hpp"
#include "host_tools/diagnose/plain_error.hpp"
#include "host_tools/effects/forward.hpp"

namespace fxdyn::diagnosis {

/// Sums over some seconds of a joint's rows that judge: squares without and with the named effects.
struct Stretch {
  double before = 0, after = 0, rows = 0;
};

/// A share and the interval that holds it with 95 %.
struct Share {
  double share = 0, low = 0, high = 0;
};

/// Squares of judged residuals per joint, weighted to unit variance: whitened, but for joints with structure left,
/// which are judged in the whole band.
struct HeldOut {
  Eigen::VectorXd before, after, rows;
  Eigen::VectorXd leftover;  ///< structure that is left
  Eigen::VectorXd excess;    ///< .. beyond the share of it that the healthy session shows
  Eigen::VectorXd fitted_before, fitted_after, fitted_rows;  ///< of today's rows that fit, with a fit of all
  Eigen::VectorXd plain_before, plain_after;    ///< of all joints in the whole band; empty: no joint is judged in it
  std::vector<Eigen::VectorXd> alone;           ///< by named group: what comes back when it alone is removed
  std::vector<std::vector<Stretch>> stretches;  ///< by joint
};

/// What the data that fitted no coefficient say of the named effects.
struct Gate {
  HeldOut held;
  std::vector<std::size_t> groups;  ///< of Outcome::at, in the model's order
  Eigen::VectorXd gap;              ///< what there was to close: closed, and left over in excess
  Eigen::VectorXd closure;
  std::vector<double> robot_closure;  ///< by group; effects on the body only
  std::vector<double> robot_form;     ///< likewise, form_on_robot()
  std::vector<bool> remains;          ///< structure that counts is left
  std::vector<bool> of_law;           ///< what is left is no more than the error of a law of friction
  std::vector<bool> accepted;         ///< the joint's gap is closed by its names
  std::vector<OwnEvidence> own;       ///< by group; effects at a joint only
  std::vector<bool> believed;         ///< by group

  /// Place of an effect in `groups`; groups.size(): it has none.
  std::size_t place(const Linearised& problem, const EffectId& id) const;
};

/// Share of a joint's gap that no finding explains: excess / gap. Its variance is that of a ratio of sums over
/// stretches r, var = sum_s (left_s - r gap_s)^2 / gap^2 (Cochran 1977, Sampling Techniques, ch. 6), since neighbouring
/// errors are not independent.
Share left_of(const HeldOut& held, double gap, Eigen::Index joint);

/// Judges the outcome as it is, each fold by a fit of the others.
Gate judge_again(const Outcome& outcome, const std::vector<SessionLog>& logs, const std::vector<bool>& still);

/// Squares of the error on what judges, which two outcomes of the same logs are compared by: plain_error(), and where
/// there are no such logs that of train logs that judge one another.
Eigen::VectorXd judged_error(const Models& models, const std::vector<SessionLog>& logs);

/// Judges each fold by a fit of the others; time constants of drift are chosen by that, and names that do not hold are
/// taken out of the outcome one by one: first several of a joint's position that one free curve in their place is
/// likelier than; then those that may be why a joint's plain error on the validate logs is larger than
/// that of `nominal` (rows near standstill, of which the search believes little, count there too), or, where there are
/// no such logs, that on train logs that judge one another larger than without what was found; of several the one
/// without which least is harmed. Then those that bring nothing; those that spoil a joint at which nothing was found;
/// and those not believed at joints that show no more structure than their background. Where a joint is harmed,
/// fit_without_harm() comes first.
Gate pass(Outcome& outcome, const IdentifiedModel& nominal, const std::vector<SessionLog>& logs,
          const std::vector<bool>& still);

/// Where a model errs more than the one before at a joint (harmed_joints()): the finding there with the least score,
/// else one on the robot, else one at another joint. Else one that is at nothing in that model. None: there is no such.
std::optional<EffectId> harmful_finding(const Outcome& outcome, const IdentifiedModel& before,
                                        const IdentifiedModel& after, const std::vector<SessionLog>& logs);
/// Takes a finding out of the outcome and fits what is left again.
/// @param gone a copy, since findings move up as one goes
void take_out(Outcome& outcome, EffectId gone, const std::vector<SessionLog>& logs);

}  // namespace fxdyn::diagnosis
