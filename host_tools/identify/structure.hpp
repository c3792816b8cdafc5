#pragma once

#include "host_tools/effects/effects.hpp"
#include "host_tools/identify/identify.hpp"

namespace fxdyn {

/// Structures that others are compared with: friction that everybody has, the paper's reference (LuGre), and Dahl's
/// presliding beside Stribeck's curve.
inline const std::vector<std::string> coulomb_and_viscous = nominal_effects();
inline const std::vector<std::string> lugre_friction = nominal_effects_and({"lugre"});
inline const std::vector<std::string> dahl_stribeck_friction = nominal_effects_and({"stribeck", "presliding"});

/// The project with these effects and nothing else: no choice of effects, no physical or essential parameters.
Project with_structure(Project project, const std::vector<std::string>& effects, const std::string& method);

/// Rigid body and `effects` identified on the project's train logs; method rls: the last of the recursive estimates.
IdentifiedModel identify_structure(const Project& project, GateData data, const std::vector<std::string>& effects,
                                   const std::string& method, Progress& progress);

/// Rigid body and rotors alone of a model that has more: no friction is hidden in inertias, as it is where a rigid body
/// alone was identified.
IdentifiedModel rigid_part(IdentifiedModel model);

}  // namespace fxdyn
