#pragma once

#include <Eigen/Dense>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/effects/forward.hpp"
#include "host_tools/effects/robot_columns.hpp"
#include "host_tools/excite/plan.hpp"

// The motion to record next: what a diagnosis left open, and the motion that decides it.

namespace fxdyn {

/// Whether it is this effect, or a rival, or nothing.
struct EffectQuestion {
  EffectCandidate effect;        ///< with the shape that was found, or a typical one
  Eigen::VectorXd coefficients;  ///< of its columns, as found; empty: such that its torque is `share` of rated (RMS)
  double share = 0;              ///< of the rated torque
  std::string rival;             ///< another effect; empty: nothing
  std::size_t rival_joint = 0;   ///< from 0; no meaning for effects on the body
  std::optional<double> odds_so_far;  ///< log10, of the logs that were diagnosed
  std::string why;                    ///< likely, undecided, not_identifiable
};

/// A joint that no effect explains, and where its gap sits.
struct PlaceQuestion {
  std::size_t joint = 0;     ///< from 0
  std::size_t of_joint = 0;  ///< whose motion it is; the joint's own, or another one's position
  std::string signal;        ///< q, dq, speed, ddq, direction
  double from = 0, to = 0;
};

struct OpenQuestions {
  std::vector<EffectQuestion> effects;
  std::vector<PlaceQuestion> places;
  std::vector<std::string> unplanned{};  ///< open, but nothing that motion can be planned for: sentences
  bool known_base =
      false;  ///< a healthy session of the same motions tells the base parameters, its friction fitted apart
  bool empty() const { return effects.empty() && places.empty() && unplanned.empty(); }
};

struct NextMotionOptions {
  /// log10 odds beyond which a question counts as decided; what a name needs, twice over (design section 3)
  double enough = 6;
  /// log10 odds that no drawn motion reaches: motion alone does not decide it; hand
  double hopeless = 0.1;
  /// s; motion within a place beyond which more is worth nothing, the same in each part of it; some ten independent
  /// samples at 1 Hz
  double enough_s = 5;
  Eigen::Index parts = 5;  ///< of a place
  /// share of the joint's velocity limit; below it the joint stands, and shows one point of its place; hand
  double standing = 1e-3;
  std::size_t draws = 24;        ///< random motions of each kind, to choose from
  int generations = 12;          ///< of the search about the best one
  std::size_t most_motions = 2;  ///< of period_s each
};

/// What the planned motions decide.
struct NextMotions {
  std::vector<PlannedTrajectory> trajectories;
  Eigen::VectorXd odds;               ///< expected log10 odds of each effect question, of these motions alone
  Eigen::VectorXd usual;              ///< the same of the random motion in the middle, of as many seconds
  std::vector<bool> hopeless;         ///< no drawn motion shows this question: nothing is planned for it
  std::vector<bool> hopeless_places;  ///< no drawn motion comes there
  Eigen::VectorXd seconds;  ///< within each place, at most options.enough_s / options.parts in each part of it
  std::vector<std::string> notes;
};

/// Motions within the project's limits that separate what is open. An effect with torque C theta is told from its rival
/// by the squared norm of what nominal model and rival can't imitate, over the noise,
///   chi^2 = theta^T (S_cc - S_cr S_rr^+ S_rc) theta,   S = G - G_.n G_nn^+ G_n.,
/// G the information (effect_information.hpp), c, r and n the columns of effect, rival and nominal model: log10 odds =
/// chi^2 / (2 ln 10), the least over the rival's shapes. It counts the new motions alone: the old ones are for free.
/// @param model without the effects in question @param noise within the torque cut-off, RMS per joint [N*m | N]
/// @param directory where model.json may be, for limits on the torque
/// Without a question that motion decides there are no trajectories. @throws InputError: as make_plan()
NextMotions plan_next(const Project& project, const IdentifiedModel& model, const OpenQuestions& questions,
                      const Eigen::VectorXd& noise, const std::filesystem::path& directory, Progress& progress,
                      const NextMotionOptions& options = {});

}  // namespace fxdyn
