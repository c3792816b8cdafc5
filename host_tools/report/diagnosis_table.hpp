#pragma once

#include <string>

#include "host_tools/report/diagnosis_result.hpp"
#include "host_tools/report/terminal.hpp"

namespace fxdyn {

/// A diagnosis for people, at most as wide as the terminal: a row a joint (verdict, gap before and after, noise floor,
/// closure, effects with parameters), then where the gap sits, what else would explain it, effects on the robot as a
/// whole, what can't be identified, the evidence (fixed point, closed loop) and the next experiment.
std::string diagnosis_table(const DiagnosisResult& diagnosis, const Terminal& on = {});

}  // namespace fxdyn
