#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace fxdyn::diagnosis_words {

/// diagnosis.json in words, for terminal and report. What is missing or null in the file becomes "" or "-".

/// "partly explained" of "partly_explained".
std::string verdict(const nlohmann::json& of);
/// Number with three digits, or "-".
std::string figure(const nlohmann::json& of, const char* key);
/// "83 %", or "-".
std::string share(const nlohmann::json& of, const char* key);
/// "12 % (8 .. 17)": what no finding explains of a joint's gap; "-" where there was none.
std::string left(const nlohmann::json& joint);
/// "established: 10^12 to 1", "likely: 80 to 1 against presliding".
std::string certainty(const nlohmann::json& effect);
/// "presliding or lugre" of a list of names.
std::string either(const nlohmann::json& names);
/// "stribeck amplitude 2.1+-0.05 N*m, velocity 0.03 rad/s"; `plus_minus`: "+-" or " ± ".
std::string effect(const nlohmann::json& of, const char* plus_minus);
/// "amplitude 2.1+-0.05 N*m, ..": the effect's parameters alone.
std::string parameters(const nlohmann::json& of, const char* plus_minus);
/// Sentence on where a joint's gap sits, and the further regions; "" where there is none.
std::string where(const nlohmann::json& joint);
/// "joint_2 (4.45 -> 5.37 N*m; 1.6 -> 1.2 on the gate data)": joints at which the error rises on the test logs; "":
/// none.
std::string not_borne_out(const nlohmann::json& diagnosis);
/// Items "a, b" of a list of names (or of objects with "effect").
std::string list(const nlohmann::json& of);
/// "joint_1", or "joint 1" where it has no name.
std::string joint(const nlohmann::json& of, std::size_t place);
/// "test logs; change since a baseline", or "".
std::string figures_on(const nlohmann::json& diagnosis);
/// Sentences on what to do next: of the robot, then those of single joints.
std::string next_experiment(const nlohmann::json& diagnosis);

}  // namespace fxdyn::diagnosis_words
