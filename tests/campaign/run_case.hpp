#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/campaign/case.hpp"

namespace fxdyn::campaign {

struct RunSettings {
  std::filesystem::path out;      ///< of the campaign
  std::filesystem::path program;  ///< fxdyn
  std::string program_hash;       ///< its answers are not taken for another's
  std::string own_hash;           ///< of the campaign: nor are its cases and scores
  double time_limit_s = 300;      ///< of one diagnosis
  bool keep = false;              ///< logs of cases that passed, too
};

/// What an earlier run with the same programs made of the case; null: nothing.
nlohmann::json earlier_result(const Case& wanted, const RunSettings& settings);

/// The case's project and logs in OUT/cases/NAME/data, its truth in OUT/truth/NAME, or what an earlier run made of it.
/// Never throws for what goes wrong in the case: without "status" all is well.
///   status: failed | not_generated (no joint reaches the size)
nlohmann::json made_case(const Case& wanted, const RunSettings& settings);

/// Scores what the fleet says of a case, and keeps it in OUT/cases/NAME/result.json.
/// @param made of made_case() @param robot of fleet.json; null where the case could not be had
///   status: done | failed (diagnose crashed, took too long, wrote nonsense) | not_generated
nlohmann::json scored_case(const Case& wanted, const RunSettings& settings, const nlohmann::json& made,
                           const nlohmann::json& robot);

}  // namespace fxdyn::campaign
