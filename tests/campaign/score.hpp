#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

namespace fxdyn::campaign {

/// What diagnosis.json names: an effect at a joint (from 1; 0: on the body), strongest first.
struct Named {
  std::string effect;
  std::size_t joint = 0;
  double score = 0;
  std::vector<std::string> alternatives;
};
std::vector<Named> named_effects(const nlohmann::json& diagnosis, const std::string& certainty = "established");

/// The verdict on one case: what was said beside what is true. `truth`, `diagnosis`: truth.json and diagnosis.json;
/// `closure` of true_closure(), where the case has one.
nlohmann::json score(const nlohmann::json& truth, const nlohmann::json& diagnosis, std::optional<double> closure);

/// 1 - (error after / error before)^2 of the models' torque against the noise-free one, over the test logs with exact
/// motion, of all joints together (errors in shares of rated torque). Nothing where the case has no effect
/// of the catalogue or its torque changes by less than 0.05 % of rated.
std::optional<double> true_closure(const nlohmann::json& truth, const std::filesystem::path& truth_folder,
                                   const std::filesystem::path& diagnosis_folder);

}  // namespace fxdyn::campaign
