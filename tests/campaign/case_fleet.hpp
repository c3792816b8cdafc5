#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tests/campaign/run_case.hpp"

// The cases as a fleet of robots: OUT/fleet.toml, its results in OUT/fleet.
namespace fxdyn::campaign {

/// OUT/fleet.toml of these cases, and no results of another program in OUT/fleet.
void write_fleet(const std::vector<std::string>& names, const RunSettings& settings);

/// `fxdyn fleet` on it, with further words of its command line. Returns the robots of OUT/fleet/fleet.json by the names
/// of their cases. @throws DataError: it was stopped, or could not work
std::map<std::string, nlohmann::json> run_fleet(const RunSettings& settings, const std::vector<std::string>& words);

/// The file that fleet.json links for a robot; empty: it has none.
std::filesystem::path diagnosis_of(const std::filesystem::path& out, const nlohmann::json& robot);
/// That its diagnosis took [s]. fleet.json has no times: it has the same bytes whoever made it.
std::optional<double> seconds_of(const std::filesystem::path& out, const std::string& name);

}  // namespace fxdyn::campaign
