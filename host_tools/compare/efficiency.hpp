#pragma once

#include <filesystem>
#include <string>

#include "host_tools/report/efficiency_result.hpp"

namespace fxdyn {

/// `fxdyn efficiency`: test error of each method against the seconds of train data that it had, and against the share
/// of slow motion among them. Returns efficiency.json.
///
/// The train logs are fast, or slow where their RMS velocity is below half of the fastest's; S seconds with a share s
/// of slow motion are the first S (1 - s) of the fast logs and the first S s of the slow ones, in the project's order.
/// Logs that are cut lose the filter's edges like others. Methods that choose by validate logs (mlp, bls_physical) have
/// all of them whatever S is, the structural ones need none. Errors as in compare().
/// @throws DataError: no test or validate log, no slow or no fast train log
EfficiencyResult efficiency(const std::filesystem::path& project, const std::filesystem::path& directory);

/// For the terminal.
std::string efficiency_table(const EfficiencyResult& result);

}  // namespace fxdyn
