#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/regression/metrics.hpp"

namespace fxdyn {

struct ReplayResult;

/// What a result in DIR has to belong to; else it counts as missing.
enum class Belongs {
  to_anything,
  to_tables,     ///< of the model (CRC)
  to_diagnosis,  ///< nominal.json, from which it started, is of the model's project and logs
  to_inputs,     ///< project file, logs and model are as they were
};
/// DIR/name.json; no name: none.
struct ResultFile {
  std::string_view name;
  Belongs belongs = Belongs::to_anything;
};

/// What the stages left in DIR, as far as it belongs together.
struct Results {
  std::map<std::string, nlohmann::json, std::less<>> files;
  std::vector<std::string> stale;       ///< verbs whose results are left out because they belong to something else
  std::vector<std::string> unreadable;  ///< files that are no JSON, as one that was half written; left out too
  std::string role;                     ///< of the logs that a reader wants to see: test, else validate, else train
  /// Null where it is missing or left out.
  const nlohmann::json& operator[](std::string_view name) const;
};
/// The files that the report's sections need.
Results read_results(const std::filesystem::path& directory);

/// "rigid body only", "+ friction", "+ BLS".
std::string stage_title(const StageErrors& stage);

/// What a replay comes to, over all its logs.
struct ReplaySummary {
  std::int64_t ticks = 0, different_ticks = 0, saturations = 0;
  std::uint32_t fewest = 0, most = 0;  ///< instructions a tick
  std::string processor;               ///< as in "Cortex-M4"
};
ReplaySummary summarise_replay(const ReplayResult& result);

}  // namespace fxdyn
