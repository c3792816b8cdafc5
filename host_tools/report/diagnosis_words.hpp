#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/report/diagnosis_result.hpp"

namespace fxdyn::diagnosis_words {

/// A diagnosis in words, for terminal and report. What is not known becomes "" or "-".

/// "partly explained" of `partly_explained`.
std::string verdict(Verdict of);
/// Number with three digits, or "-".
std::string figure(std::optional<double> value);
/// "83 %", or "-".
std::string share(std::optional<double> value);
/// "12 % (8 .. 17)": what no finding explains of a joint's gap; "-" where there was none.
std::string left(const std::optional<GapLeft>& of);
/// "established: 10^12 to 1", "likely: 80 to 1 against presliding".
std::string certainty(const NamedEffect& effect);
/// "friction rises by 0.8 N*m between 0.85 and 1.05 rad (friction_over_position, 10^12 to 1): closes 83 %"; with the
/// other variable where the logs don't tell which.
std::string curve(const CurveResult& of);
/// "presliding or lugre" of a list of names.
std::string either(const std::vector<std::string>& names);
/// "stribeck amplitude 2.1+-0.05 N*m, velocity 0.03 rad/s"; `plus_minus`: "+-" or " ± ".
std::string effect(const NamedEffect& of, const char* plus_minus);
/// "amplitude 2.1+-0.05 N*m, ..": the effect's parameters alone.
std::string parameters(const NamedEffect& of, const char* plus_minus);
/// "joint_2 (4.45 -> 5.37 N*m; 1.6 -> 1.2 on the gate data)": joints at which the error rises on the test logs; "":
/// none.
std::string not_borne_out(const DiagnosisResult& diagnosis);
/// The experiments that `next_experiment` proposes, one after the other.
std::vector<std::string> experiments(const std::string& all);
/// "a, b"
std::string list(const std::vector<std::string>& names);
/// "2, 3": joints, from 1; "" where it is not known which.
std::string list(const std::optional<std::vector<std::size_t>>& joints);
/// "test logs; change since the baseline", or "".
std::string figures_on(const DiagnosisResult& diagnosis);

}  // namespace fxdyn::diagnosis_words
