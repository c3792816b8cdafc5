#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_tools/diagnose/explore.hpp"
#include "host_tools/report/diagnosis_result.hpp"

namespace fxdyn::diagnosis {

/// A free curve (model/effects/curve.hpp) of what has no name at a joint.
struct FreeCurve {
  EffectId id;                         ///< of Models::current
  EffectCandidate effect;              ///< its variable, and over which interval its knots are
  double odds_nothing = 0;             ///< log10, on data that did not fit it
  std::optional<double> odds_rival{};  ///< .. against the best functions of another variable; none: there is none
  std::string rival{};
  double closes = 0;  ///< share of the error's power on what judges that it takes away
};

/// What is left at a joint, as the free curve that explains most of it: of every variable (the own position, velocity,
/// load; friction over the position; another joint's position), with knots over the whole motion and over halves,
/// quarters and eighths of it, each judged by a fit of the others' folds with all that the model has. What one log
/// alone has is judged by parts of it. Rows count as diluted_weights() says; the number of curves tried is taken off
/// the odds. None where functions of variables that have no curve are surer (left_without_curve()). Fits all of them
/// together, and gives up those that harm a joint.
/// @param models the curves are added, as named effects; @param without joints that get none
std::vector<FreeCurve> add_free_curves(Models& models, const std::vector<SessionLog>& logs,
                                       const std::vector<bool>& without);

/// The curve over its interval with its deviation, as the models have it. What nominal effects have of the same
/// variable (offset, dry and viscous friction, a gain) is not its own: their part is taken off, by least squares over
/// the logs that fit. The deviation counts what twelve heights can't follow, too.
CurveResult drawn(const Models& models, const FreeCurve& curve, const std::vector<SessionLog>& logs);

}  // namespace fxdyn::diagnosis
