#pragma once

#include <numbers>
#include <optional>
#include <vector>

#include "host_tools/diagnose/search.hpp"

namespace fxdyn::diagnosis {

struct Outcome;

/// How sure the name of an effect is, on data that did not fit it.
enum class Certainty {
  unlisted,
  likely,      ///< it may stand in for something else, or be nothing
  established  ///< it is there, and no other effect of the catalogue explains what it does
};

/// Noise variances, or differences of -2 ln p, that one decade of odds is.
inline constexpr double variances_per_decade = 2 * std::numbers::ln10;

/// What speaks for an effect. Odds are log10 of likelihood ratios on the logs that judge.
struct Evidence {
  /// Where the data rather have the same effect in the healthy session too, which is no change: against that, below 0.
  double against_nothing = 0;
  std::optional<double> against_rival{};  ///< none: nothing else comes near
  double deviations = 0;                  ///< standard deviations by which its coefficients are off nothing
  double gain = 0;                        ///< noise variances that come back without it, at its joint
  double closure = 0;                     ///< .. as a share of the gap
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

}  // namespace fxdyn::diagnosis
