#pragma once

#include <nlohmann/json.hpp>

namespace fxdyn {

/// The catalogue for machines: of each effect its name, equation, words, experiment, those that it is confused with,
/// and its parameters with unit, bounds and source.
nlohmann::json effects_json();

}  // namespace fxdyn
