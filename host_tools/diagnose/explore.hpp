#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/diagnose/lack_of_fit.hpp"
#include "host_tools/diagnose/models.hpp"
#include "host_tools/diagnose/search.hpp"

namespace fxdyn::diagnosis {

/// How sure the name of an effect is, on data that did not fit it.
enum class Certainty {
  unlisted,
  likely,      ///< it may stand in for something else, or be nothing
  established  ///< it is there, and no other effect of the catalogue explains what it does
};

/// What speaks for an effect. Odds are log10 of likelihood ratios on the logs that judge.
struct Evidence {
  double against_nothing = 0;
  std::optional<double> against_rival{};  ///< none: nothing else comes near
  double deviations = 0;                  ///< standard deviations by which its coefficients are off nothing
  double closure = 0;                     ///< share of the gap that comes back without it
  bool there = false;      ///< something like it is there for sure: the model keeps it, whatever its name
  bool undecided = false;  ///< .. its form holds, and that of its rival as well
  Certainty certainty = Certainty::unlisted;
};

/// An effect that the search added to the model, and what speaks for it.
struct Finding {
  EffectId id;
  double score = 0;
  std::vector<Alternative> alternatives;
  std::optional<Rival> rival{};
  Evidence evidence{};
};

/// What a search came to.
struct Outcome {
  Models models;
  std::vector<Finding> found;
  std::unique_ptr<Linearised> problem;  ///< around the models, without candidates
  std::vector<Eigen::MatrixXd> features;
  std::vector<LackOfFit> lack;
  std::vector<std::vector<std::string>> not_identifiable;  ///< per joint, and of the robot
  std::vector<Eigen::VectorXd> whitening;

  bool structured() const;  ///< at any joint
  bool structured(std::size_t joint) const;
  /// Linearises around the models again and looks for lack of fit.
  void look_again(const std::vector<SessionLog>& logs);
};

/// Search, name, fit again around what was named; again where that left structure or found several effects.
/// @param passes at most
Outcome explore(Models models, const std::vector<SessionLog>& logs, const SearchSettings& settings,
                const std::vector<EffectCandidate>& never, int passes, Progress& progress);

}  // namespace fxdyn::diagnosis
