#pragma once

#include <string_view>

#include "host_tools/identify/options.hpp"
#include "host_tools/regression/fitter.hpp"

namespace fxdyn {

/// A joint's design and how it did on the rows that judge.
struct Candidate {
  JointFit design;
  Judgement judgement;
};

/// How far and how fast a joint moves in the logs.
struct Scales {
  double velocity;  ///< [rad/s | m/s]
  double range;     ///< [rad | m]
};

/// The joint's design at its best width of the Coulomb sign.
Candidate search_width(const Fitter& fitter, std::size_t joint, const Scales& scales);
/// The joint's design with the effect added, at its best shape; in place of those that it unites
/// (EffectTraits::unites), at whose shapes the search begins.
/// @throws InputError: the effect needs a second joint
Candidate search_effect(const Fitter& fitter, std::size_t joint, std::string_view effect, const Scales& scales,
                        const StructureOptions& options);

}  // namespace fxdyn
