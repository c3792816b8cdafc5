#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/campaign/case.hpp"

namespace fxdyn::campaign {

struct RunSettings {
  std::filesystem::path out;      ///< of the campaign
  std::filesystem::path program;  ///< fxdyn
  std::string program_hash;       ///< results of another program are not taken for this one's
  double time_limit_s = 300;      ///< of one diagnosis
  bool keep = false;              ///< logs of cases that passed, too
};

/// Generates, diagnoses and scores a case, or reads what an earlier run wrote. The result is also written to
/// OUT/cases/NAME/result.json. Never throws for what goes wrong in the case: "status" says so.
///   done | failed (diagnose crashed, took too long, wrote nonsense) | not_generated (no joint reaches the size)
nlohmann::json run_case(const Case& wanted, const RunSettings& settings);

}  // namespace fxdyn::campaign
