#pragma once

#include <optional>
#include <vector>

#include "host_tools/diagnose/explore.hpp"
#include "host_tools/diagnose/gate.hpp"
#include "host_tools/diagnose/left_curves.hpp"
#include "host_tools/effects/joint_fit.hpp"

namespace fxdyn::diagnosis {

/// Concludes from the odds and deviations of an effect.
/// @param holds its form holds against a free curve of its variable, see Gate::believed
/// @param form share of such a curve's closure that it has
void judge(Evidence& evidence, bool holds, double form, const GateOptions& options);

/// What the data say against the same effect in both sessions instead of in today's alone [noise variances]: what the
/// healthy robot has too, too little of it for the healthy session alone to show, is no change. Linear, with shapes as
/// they are.
/// @param problem with a baseline; gets columns, which are in no model
/// @param groups of its model; @param i place there of the effect, which is not on the body
double new_since_baseline(Linearised& problem, const std::vector<std::size_t>& groups, std::size_t i);

/// What speaks for each finding, with all of them in the model.
void weigh_evidence(Outcome& outcome, const Gate& gate);

/// An effect that is not sure enough for the model.
struct Likely {
  Finding finding;  ///< its id tells the joint
  EffectFit fit;
  std::vector<std::size_t> joints;  ///< an effect on the robot: those that feel it, from 0
};

/// Where names close less of their joint's gap than is left of it, and that is no noise (structure, or what a curve
/// closes), they may resemble what is left: none of them is established. One that was only likely before has to be the
/// larger part of what is at its joint: sooner than an effect it is what a larger one leaves, whose form is another
/// than its name's. What is there stays in the model.
/// @param curves of what is left, by joint; those of time were taken off the logs before they judged
/// @param likely loses such, too
void doubt_beside_more(Outcome& outcome, const Gate& gate, const Curves& curves, std::vector<Likely>& likely);

/// What a model was before the search, and what the search may do.
struct Retrial {
  const IdentifiedModel& nominal;
  const std::vector<SessionLog>& logs;
  const std::vector<bool>& still;
  const SearchTask& task;
};

/// An outcome around which a background that was held (Models::held) is fitted with all else. Once what it was taken
/// for is in the model, both sessions say better what it was than the healthy one alone. What only grew stays held: the
/// finding is what came on top. None: nothing else was held.
std::optional<Outcome> with_free_background(const Outcome& outcome, const std::vector<SessionLog>& logs);
/// Judges another outcome of the same search, and takes it where it errs less on what judges.
/// @param gate of the outcome
/// @returns whether it took it
bool take_if_better(Outcome& outcome, Gate& gate, Outcome other, const Retrial& retrial);

/// The effects of an outcome's findings.
std::vector<EffectCandidate> named_in(const Outcome& outcome);
/// Where an effect was taken out of the model that the search saw last, it searches once more: what needs the torque of
/// the whole model can't be tried beside a part of it. Without laws that did not pass: a part of one may be there
/// alone. Whatever the test for structure says, which sees little in few rows.
/// @param before what was named before the gate @param outcome, gate after it
void search_again(const std::vector<EffectCandidate>& before, Outcome& outcome, Gate& gate, const Retrial& retrial,
                  Progress& progress);

/// Of a finding that is there for sure, and whose rival is within the odds of a sure name, that rival is tried in its
/// place, with all that is fitted and searched around it: odds are of fits that are linear around the finding, whose
/// other parameters suit it. The one whose model errs less on what judges stays.
/// @param outcome, gate with evidence; what they become has it too
/// @returns whether a rival took a place
bool settle_rivals(Outcome& outcome, Gate& gate, const Retrial& retrial, Progress& progress);

/// Weighs the evidence, takes all that is not there for sure out of the model, fits the rest again and judges it, until
/// nothing goes.
/// @param nominal the model before the search @param likely gets what of it is likely
void set_aside(Outcome& outcome, Gate& gate, const IdentifiedModel& nominal, const std::vector<SessionLog>& logs,
               const std::vector<bool>& still, std::vector<Likely>& likely);

}  // namespace fxdyn::diagnosis
