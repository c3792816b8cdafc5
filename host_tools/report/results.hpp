#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace fxdyn {

/// What the stages left in DIR, as far as it belongs together: an export or a replay of other tables
/// than the model's (CRC) counts as missing (null), and so does a diagnosis of other logs or another
/// project, and what compare, efficiency and vibration wrote for another project file, other logs or another model.
struct Results {
  nlohmann::json metrics, exported, replayed, diagnosis, compared, efficiency, vibration;
  std::vector<std::string> stale;  ///< verbs whose results are left out because they belong to something else
  std::string role;                ///< of the logs that a reader wants to see: test, else validate, else train
};
Results read_results(const std::filesystem::path& directory);

/// RMSE and RMS of the torque of one joint over all logs of a role [N*m | N], and the mean noise floor.
struct PooledError {
  double rmse = 0, rms = 0, noise_floor = 0;
  double relative() const { return rms > 0 ? rmse / rms : 0; }
};
PooledError pooled_error(const nlohmann::json& logs, const std::string& role, std::size_t joint);

/// "rigid body only", "+ friction", "+ BLS".
std::string stage_title(const nlohmann::json& stage);

/// What a replay comes to, over all its logs.
struct ReplaySummary {
  std::int64_t ticks = 0, different_ticks = 0, saturations = 0;
  std::uint32_t fewest = 0, most = 0;  ///< instructions a tick
  std::string processor;               ///< as in "Cortex-M4"
};
ReplaySummary summarise_replay(const nlohmann::json& replayed);

}  // namespace fxdyn
