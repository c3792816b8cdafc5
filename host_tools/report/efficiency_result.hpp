#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace fxdyn {

/// Test errors of methods that had so much train data.
struct EfficiencyPoint {
  double seconds = 0;
  double slow_share = 0;                                         ///< of them, of slow motion
  std::map<std::string, std::optional<double>> percent_rated{};  ///< by method, mean of the joints; none: it failed
  std::string failed{};                                          ///< why one did
};

/// Content of efficiency.json.
struct EfficiencyResult {
  std::string project_hash;
  nlohmann::json made_from;                     ///< see project/provenance.hpp
  std::vector<EfficiencyPoint> curve{}, mix{};  ///< over the seconds; over the share of slow motion
};
nlohmann::json to_json(const EfficiencyResult& result);
EfficiencyResult efficiency_of(const nlohmann::json& file);

}  // namespace fxdyn
