#include "host_tools/fleet/inputs.hpp"

#include <fmt/format.h>

#include <set>
#include <sstream>

#include "host_tools/effects/effect_library.hpp"
#include "host_tools/fleet/file_hashes.hpp"
#include "host_tools/fleet/sha256.hpp"
#include "host_tools/project/project.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/pipes.hpp"
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
  const auto text = table[key].value<std::string>();
  if (!text || *text == "-") return;
  std::string path = *text;
  try {
    path = with_home(with_variable(path));
  } catch (const InputError&) {
    return;  // whoever reads the project says it, with its line
  }
  table.insert_or_assign(key, (folder / path).lexically_normal().string());
}

void make_paths_absolute(toml::table& project, const fs::path& folder) {
  if (toml::table* robot = project.get_as<toml::table>("robot")) make_absolute(*robot, "urdf", folder);
  toml::array* logs = project.get_as<toml::array>("log");
  if (logs == nullptr) return;
  for (toml::node& log : *logs) {
    if (!log.is_table()) continue;
    make_absolute(*log.as_table(), "file", folder);
    make_absolute(*log.as_table(), "scenario", folder);
  }
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
  make_paths_absolute(table, member.project.parent_path());
  if (toml::array* logs = table.get_as<toml::array>("log")) {
    for (const fs::path& file : member.baseline) logs->push_back(baseline_entry(*logs, file));
  }
  std::ostringstream text;
  text << "# Made by fxdyn fleet from " << member.project.string() << "\n" << table << "\n";
  return text.str();
}

/// A recording may be a folder.
void add_log(std::set<fs::path>& files, const fs::path& log) {
  if (is_pipe(log)) throw InputError(log.string() + ": can be read once only: a fleet needs its logs in files");
  if (!fs::is_directory(log)) {
    files.insert(log);
    return;
  }
  for (const auto& entry : fs::directory_iterator(log)) {
    if (entry.is_regular_file()) files.insert(entry.path());
  }
}

/// And the robot that it simulates.
void add_scenario(std::set<fs::path>& files, const fs::path& scenario) {
  files.insert(scenario);
  const toml::table table = toml_input::parse(scenario);
  for (const char* key : {"urdf", "model"}) {
    const auto name = table["robot"][key].value<std::string>();
    if (name && fs::is_regular_file(scenario.parent_path() / *name)) files.insert(scenario.parent_path() / *name);
  }
}

/// What a project names, unread: only the program with its effects can read it, and that says what is wrong.
std::set<fs::path> files_named_in(const fs::path& file) {
  toml::table table = toml_input::parse(file);
  make_paths_absolute(table, file.parent_path());
  std::set<fs::path> files{file};
  if (const auto urdf = table["robot"]["urdf"].value<std::string>()) files.insert(*urdf);
  const toml::array* logs = table.get_as<toml::array>("log");
  if (logs == nullptr) return files;
  for (const toml::node& log : *logs) {
    if (!log.is_table()) continue;
    if (const auto name = (*log.as_table())["scenario"].value<std::string>()) add_scenario(files, *name);
    if (const auto name = (*log.as_table())["file"].value<std::string>()) add_log(files, *name);
  }
  return files;
}

/// What a project is made of, itself included. @throws InputError, as of read_project()
std::set<fs::path> files_of(const fs::path& file) {
  std::set<fs::path> files{file};
  try {
    const Project project = read_project(file);
    files.insert(project.urdf);
    for (const LogEntry& log : project.logs) {
      if (log.scenario)
        add_scenario(files, *log.scenario);
      else
        add_log(files, log.file);
    }
  } catch (const OtherEffectLibrary&) {
    return files_named_in(file);
  }
  return files;
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
  const std::set<fs::path> files = files_of(inputs.project);
  Sha256 all;
  all.add(fmt::format("fxdyn {}\n{}\n", version, fleet.verb));
  FileHashes hashes(folder / "files.json");
  for (const fs::path& file : files) all.add(fmt::format("{}\n{}\n", file.string(), hashes.of(file)));
  hashes.keep();
  inputs.hash = all.text();
  return inputs;
}

}  // namespace fxdyn::fleet
