#include "host_tools/report/results.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "host_tools/effects/model_identity.hpp"
#include "host_tools/project/provenance.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/report/replay_result.hpp"
#include "host_tools/report/section.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

/// Null where it is missing or no JSON.
json read_json(const fs::path& file) {
  if (!fs::exists(file)) return {};
  json content = json::parse(read_file(file), nullptr, false);
  return content.is_discarded() ? json() : content;
}

bool is_unreadable(const fs::path& file) { return fs::exists(file) && !json::accept(read_file(file)); }

/// The model in DIR; none: no model.json.
using Model = std::optional<ModelIdentity>;

/// Null where the file is missing or of other tables than the model's.
json read_of_tables(const fs::path& file, const Model& model) {
  json content = read_json(file);
  if (content.is_null() || !model || !model->tables_crc) return {};
  return content.value("tables_crc", json()) == *model->tables_crc ? content : json();
}

/// diagnosis.json, if nominal.json, from which it started, is of the model's project and logs.
json read_diagnosis(const fs::path& directory, const Model& model) {
  const Model nominal = read_identity(directory / "nominal.json");
  const bool same =
      !nominal || !model || (nominal->project_hash == model->project_hash && nominal->logs == model->logs);
  return same ? read_json(directory / "diagnosis.json") : json();
}

/// Null where the file is missing or of another project than the model's, other logs or another model.
json read_of_inputs(const std::string& verb, const fs::path& directory, const Model& model,
                    std::vector<std::string>& stale) {
  json content = read_json(directory / (verb + ".json"));
  if (content.is_null()) return content;
  const bool same = model && content.value("project_hash", json()) == model->project_hash &&
                    is_unchanged(content.value("made_from", json()), directory);
  if (same) return content;
  stale.push_back(verb);
  return {};
}

json read_result(const ResultFile& result, const fs::path& directory, const Model& model,
                 std::vector<std::string>& stale) {
  const std::string name(result.name);
  switch (result.belongs) {
    case Belongs::to_tables:
      return read_of_tables(directory / (name + ".json"), model);
    case Belongs::to_diagnosis:
      return read_diagnosis(directory, model);
    case Belongs::to_inputs:
      return read_of_inputs(name, directory, model, stale);
    case Belongs::to_anything:
      break;
  }
  return read_json(directory / (name + ".json"));
}

std::string shown_role(const std::vector<LogErrors>& logs) {
  for (const Role role : {Role::test, Role::validate}) {
    for (const LogErrors& log : logs) {
      if (log.role == role) return to_string(role);
    }
  }
  return to_string(Role::train);
}

std::string processor_of(const std::string& image) {
  constexpr std::array<std::pair<const char*, const char*>, 4> boards{
      {{"an385", "Cortex-M3"}, {"an386", "Cortex-M4"}, {"an500", "Cortex-M7"}, {"an505", "Cortex-M33"}}};
  for (const auto& [board, processor] : boards) {
    if (image.find(board) != std::string::npos) return processor;
  }
  return image;
}

}  // namespace

const json& Results::operator[](std::string_view name) const {
  static const json missing;
  const auto found = files.find(name);
  return found == files.end() ? missing : found->second;
}

Results read_results(const fs::path& directory) {
  Results results;
  const Model model = read_identity(directory / "model.json");
  for (const ReportSection& section : report_sections()) {
    const std::string name(section.needs.name);
    if (name.empty() || results.files.contains(name)) continue;
    results.files[name] = read_result(section.needs, directory, model, results.stale);
    if (is_unreadable(directory / (name + ".json"))) results.unreadable.push_back(name + ".json");
  }
  if (const json& metrics = results["metrics"]; !metrics.is_null()) results.role = shown_role(metrics_of(metrics).logs);
  return results;
}

std::string stage_title(const StageErrors& stage) {
  if (stage.stage == "rigid") return "rigid body only";
  return stage.stage == "bls" ? "+ BLS" : "+ " + stage.stage;
}

ReplaySummary summarise_replay(const ReplayResult& result) {
  ReplaySummary sum;
  sum.fewest = std::numeric_limits<std::uint32_t>::max();
  for (const ReplayedLog& log : result.logs) {
    sum.ticks += log.ticks;
    sum.different_ticks += log.different_ticks;
    sum.saturations += static_cast<std::int64_t>(log.saturations);
    sum.fewest = std::min(sum.fewest, log.fewest);
    sum.most = std::max(sum.most, log.most);
  }
  sum.processor = processor_of(result.image);
  return sum;
}

}  // namespace fxdyn
