#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace fxdyn::diagnosis_words {

/// diagnosis.json in words, for terminal and report. What is missing or null in the file becomes "" or "-".

/// "effects found" of "effects_found".
std::string verdict(const nlohmann::json& of);
/// Number with three digits, or "-".
std::string figure(const nlohmann::json& of, const char* key);
/// "83 %", or "-".
std::string share(const nlohmann::json& of, const char* key);
/// Share of the joint's gap that is closed, or "-" where there was none to close.
std::string closure(const nlohmann::json& joint);
/// "stribeck amplitude 2.1+-0.05 N*m, velocity 0.03 rad/s"; `plus_minus`: "+-" or " ± ".
std::string effect(const nlohmann::json& of, const char* plus_minus);
/// "amplitude 2.1+-0.05 N*m, ..": the effect's parameters alone.
std::string parameters(const nlohmann::json& of, const char* plus_minus);
/// "61 % of the gap at velocity -0.05 .. 0.05 rad/s", "90 % of the gap at negative velocity"; torque_unit: of the
/// joint, N*m or N.
std::string where(const nlohmann::json& of, const std::string& torque_unit);
/// Items "a, b" of a list of names (or of objects with "effect").
std::string list(const nlohmann::json& of);
/// "joint_1", or "joint 1" where it has no name.
std::string joint(const nlohmann::json& of, std::size_t place);
/// "test logs; change since a baseline", or "".
std::string figures_on(const nlohmann::json& diagnosis);
/// Sentences on what to do next: of the robot, then those of single joints.
std::string next_experiment(const nlohmann::json& diagnosis);

}  // namespace fxdyn::diagnosis_words
