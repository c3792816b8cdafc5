#include "host_tools/report/results.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "host_tools/project/provenance.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

json read_json(const fs::path& file) { return fs::exists(file) ? json::parse(read_file(file)) : json(); }

/// Null where the file is missing or of other tables than the model's.
json read_of_tables(const fs::path& file, const json& model) {
  json content = read_json(file);
  const bool same = !content.is_null() && model.contains("tables_crc") &&
                    content.value("tables_crc", json()) == model.at("tables_crc");
  return same ? content : json();
}

/// diagnosis.json, if nominal.json, from which it started, is of the model's project and logs.
json read_diagnosis(const fs::path& directory, const json& model) {
  const json nominal = read_json(directory / "nominal.json");
  for (const char* key : {"project_hash", "logs"}) {
    if (nominal.contains(key) && model.contains(key) && nominal.at(key) != model.at(key)) return {};
  }
  return read_json(directory / "diagnosis.json");
}

/// Null where the file is missing or of another project than the model's, other logs or another model.
json read_of_inputs(const std::string& verb, const fs::path& directory, const json& model,
                    std::vector<std::string>& stale) {
  json content = read_json(directory / (verb + ".json"));
  if (content.is_null()) return content;
  const bool same = !model.is_null() &&
                    content.value("project_hash", json()) == model.value("project_hash", json("")) &&
                    is_unchanged(content.value("made_from", json()), directory);
  if (same) return content;
  stale.push_back(verb);
  return {};
}

std::string shown_role(const json& logs) {
  for (const char* role : {"test", "validate"}) {
    for (const json& log : logs) {
      if (log.at("role") == role) return role;
    }
  }
  return "train";
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

Results read_results(const fs::path& directory) {
  Results results;
  results.metrics = read_json(directory / "metrics.json");
  const json model = read_json(directory / "model.json");
  results.exported = read_of_tables(directory / "export.json", model);
  results.replayed = read_of_tables(directory / "replay.json", model);
  results.diagnosis = read_diagnosis(directory, model);
  results.compared = read_of_inputs("compare", directory, model, results.stale);
  results.efficiency = read_of_inputs("efficiency", directory, model, results.stale);
  results.vibration = read_of_inputs("vibration", directory, model, results.stale);
  if (!results.metrics.is_null()) results.role = shown_role(results.metrics.at("logs"));
  return results;
}

PooledError pooled_error(const json& logs, const std::string& role, std::size_t joint) {
  double error = 0, torque = 0, floor = 0;
  int count = 0;
  for (const json& log : logs) {
    if (log.at("role") != role) continue;
    const json& entry = log.at("joints").at(joint);
    const double rmse = entry.at("rmse"), relative = entry.at("relative"), noise = entry.at("noise_floor");
    const double rms = relative > 0 ? rmse / relative : 0;
    error += rmse * rmse;
    torque += rms * rms;
    floor += noise * noise;
    ++count;
  }
  const double n = std::max(1, count);
  return {std::sqrt(error / n), std::sqrt(torque / n), std::sqrt(floor / n)};
}

std::string stage_title(const json& stage) {
  const std::string name = stage.at("stage");
  if (name == "rigid") return "rigid body only";
  return name == "bls" ? "+ BLS" : "+ " + name;
}

ReplaySummary summarise_replay(const json& replayed) {
  ReplaySummary sum;
  sum.fewest = std::numeric_limits<std::uint32_t>::max();
  for (const json& log : replayed.at("logs")) {
    sum.ticks += log.at("ticks").get<std::int64_t>();
    sum.different_ticks += log.at("different_ticks").get<std::int64_t>();
    sum.saturations += log.at("saturations").get<std::int64_t>();
    sum.fewest = std::min(sum.fewest, log.at("instructions_per_tick").at("fewest").get<std::uint32_t>());
    sum.most = std::max(sum.most, log.at("instructions_per_tick").at("most").get<std::uint32_t>());
  }
  sum.processor = processor_of(replayed.at("image"));
  return sum;
}

}  // namespace fxdyn
