#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace fxdyn {

/// diagnosis.json for people, at most 100 columns wide: a row a joint (verdict, gap before and after, noise floor,
/// closure, effects with parameters), then where the gap sits, what else would explain it, effects on the robot as a
/// whole, what can't be identified, the evidence (fixed point, closed loop) and the next experiment.
std::string diagnosis_table(const nlohmann::json& diagnosis);

}  // namespace fxdyn
