#include "host_tools/project/provenance.hpp"

#include <cstring>
#include <sstream>

#include "host_tools/effects/model_identity.hpp"
#include "host_tools/project/log_entries.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/toml.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

/// Null where there is no model.
json hash_of_model(const fs::path& directory) {
  const std::string hash = hash_without_tables(directory / "model.json");
  return hash.empty() ? json() : json(hash);
}

json read_seconds(const fs::path& directory) {
  const fs::path file = directory / "timing.json";
  if (!fs::exists(file)) return json::object();
  return json::parse(read_file(file)).value("seconds", json::object());
}

}  // namespace

std::string project_hash(const Project& project) {
  toml::table table = toml_input::parse(project.file);
  // What export alone asks for: a refused export goes on from the model that is there.
  if (toml::table* target = table["target"].as_table()) {
    target->erase("accept_error");
    if (target->empty()) table.erase("target");
  }
  table.erase("report");  // how results are shown
  std::ostringstream text;
  text << table;
  return hash_of(text.str() + read_file(project.urdf));
}

json made_from(const Project& project, const fs::path& directory, bool of_model) {
  json out{{"logs", json::object()}};
  for (const LogEntry& entry : project.logs) {
    const fs::path file = log_file(entry, directory);
    out["logs"][fs::relative(file, directory).generic_string()] = hash_of_file(file);
  }
  if (of_model) out["model"] = hash_of_model(directory);
  return out;
}

bool is_unchanged(const json& made_from, const fs::path& directory) {
  if (!made_from.is_object()) return false;
  for (const auto& [file, hash] : made_from.at("logs").items()) {
    if (!fs::exists(directory / file) || hash_of_file(directory / file) != hash.get<std::string>()) return false;
  }
  return !made_from.contains("model") || made_from.at("model") == hash_of_model(directory);
}

void note_seconds(const fs::path& directory, const char* verb, double seconds) {
  json all = read_seconds(directory);
  all[verb] = seconds;
  write_file(directory / "timing.json", json{{"schema", "fxdyn.timing/1"}, {"seconds", all}}.dump(1) + "\n");
}

std::optional<double> training_seconds(const fs::path& directory) {
  const json all = read_seconds(directory);
  if (!all.contains("diagnose") || !all.contains("train")) return {};
  return all.at("diagnose").get<double>() + all.at("train").get<double>();
}

PageHeader header_of(const fs::path& page) {
  const std::string bytes = read_file(page);
  PageHeader header;
  if (bytes.size() < sizeof header) return {.magic = 0};
  std::memcpy(&header, bytes.data(), sizeof header);
  return header;
}

}  // namespace fxdyn
