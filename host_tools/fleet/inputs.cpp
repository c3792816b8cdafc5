#include "host_tools/fleet/inputs.hpp"

#include <fmt/format.h>

#include <set>
#include <sstream>

#include "host_tools/fleet/file_hashes.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/pipes.hpp"
#include "host_tools/support/sha256.hpp"
#include "host_tools/support/toml.hpp"
#include "model/version.hpp"

namespace fxdyn::fleet {
namespace {

namespace fs = std::filesystem;

/// Tables are merged, all else is replaced.
void replace(toml::table& target, const toml::table& source) {
  for (const auto& [key, node] : source) {
    toml::table* there = target.get_as<toml::table>(key.str());
    if (there != nullptr && node.is_table())
      replace(*there, *node.as_table());
    else
      target.insert_or_assign(key.str(), node);
  }
}

/// The file moves, what it names does not.
void make_absolute(toml::table& table, std::string_view key, const fs::path& folder) {
  if (const auto text = table[key].value<std::string>(); text && *text != "-")
    table.insert_or_assign(key, (folder / *text).lexically_normal().string());
}

/// A log entry that is read as the first train log is: same columns, units and gains.
toml::table baseline_entry(const toml::array& logs, const fs::path& file) {
  toml::table entry;
  for (const toml::node& log : logs) {
    const toml::table* known = log.as_table();
    if (known == nullptr || (*known)["role"].value_or(std::string()) != "train") continue;
    entry = *known;
    for (const char* key : {"scenario", "log", "from_s", "to_s", "payload"}) entry.erase(key);
    break;
  }
  entry.insert_or_assign("file", file.string());
  entry.insert_or_assign("role", "baseline");
  return entry;
}

std::string project_with(const Member& member) {
  toml::table table = toml_input::parse(member.project);
  replace(table, toml::parse(member.overrides));
  const fs::path folder = member.project.parent_path();
  if (toml::table* robot = table.get_as<toml::table>("robot")) make_absolute(*robot, "urdf", folder);
  if (toml::array* logs = table.get_as<toml::array>("log")) {
    for (toml::node& log : *logs) {
      if (!log.is_table()) continue;
      make_absolute(*log.as_table(), "file", folder);
      make_absolute(*log.as_table(), "scenario", folder);
    }
    for (const fs::path& file : member.baseline) logs->push_back(baseline_entry(*logs, file));
  }
  std::ostringstream text;
  text << "# Made by fxdyn fleet from " << member.project.string() << "\n" << table << "\n";
  return text.str();
}

/// The robot that a scenario simulates; empty: it names none.
fs::path urdf_of_scenario(const fs::path& scenario) {
  const toml::table table = toml_input::parse(scenario);
  const auto name = table["robot"]["urdf"].value<std::string>();
  return name ? scenario.parent_path() / *name : fs::path();
}

}  // namespace

Inputs inputs_of(const Fleet& fleet, const Member& member, const fs::path& folder) {
  if (!fs::is_regular_file(member.project))
    throw InputError(fmt::format("{}: the project is gone: bring it back, or take '{}' out of {}",
                                 member.project.string(), member.id, fleet.file.filename().string()));
  Inputs inputs{member.project, ""};
  if (!member.overrides.empty() || !member.baseline.empty()) {
    inputs.project = folder / "project.toml";
    const std::string text = project_with(member);
    if (!fs::exists(inputs.project) || read_file(inputs.project) != text) write_file(inputs.project, text);
  }
  const Project project = read_project(inputs.project);
  std::set<fs::path> files{inputs.project, project.urdf};
  for (const LogEntry& log : project.logs) {
    if (is_pipe(log.file))
      throw InputError(log.file.string() + ": can be read once only: a fleet needs its logs in files");
    if (!log.scenario) {
      files.insert(log.file);
      continue;
    }
    files.insert(*log.scenario);
    if (const fs::path urdf = urdf_of_scenario(*log.scenario); fs::is_regular_file(urdf)) files.insert(urdf);
  }
  Sha256 all;
  all.add(fmt::format("fxdyn {}\n{}\n", version, fleet.verb));
  FileHashes hashes(folder / "files.json");
  for (const fs::path& file : files) all.add(fmt::format("{}\n{}\n", file.string(), hashes.of(file)));
  hashes.keep();
  inputs.hash = all.text();
  return inputs;
}

}  // namespace fxdyn::fleet
