#include "host_tools/fleet/fleet_file.hpp"

#include <fmt/format.h>
#include <glob.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <sstream>

#include "host_tools/support/pipes.hpp"
#include "host_tools/support/toml.hpp"

namespace fxdyn::fleet {
namespace {

namespace fs = std::filesystem;
using toml_input::as_positive;
using toml_input::set;
using toml_input::Table;
using toml_input::Value;

/// Stages whose results a summary can read.
const toml_input::Names verb_names{"diagnose", "identify", "train", "export", "report", "run"};

/// Ids are names of folders.
bool is_id(const std::string& text) {
  constexpr std::size_t longest = 100;
  return !text.empty() && text.size() <= longest && text.front() != '.' && text.front() != '-' &&
         std::all_of(text.begin(), text.end(),
                     [](unsigned char c) { return std::isalnum(c) != 0 || c == '.' || c == '_' || c == '-'; });
}

/// Of a path that a pattern found: the last part that the pattern left open.
std::string id_of(const fs::path& found, const fs::path& pattern) {
  std::vector<std::string> parts, open;
  for (const fs::path& part : found) parts.push_back(part.string());
  for (const fs::path& part : pattern) open.push_back(part.string());
  for (std::size_t back = 1; back <= std::min(parts.size(), open.size()); ++back) {
    if (open[open.size() - back].find_first_of("*?[") == std::string::npos) continue;
    return back == 1 ? found.stem().string() : parts[parts.size() - back];
  }
  return found.stem().string();
}

std::vector<fs::path> files_of(const fs::path& pattern) {
  glob_t found{};
  std::vector<fs::path> out;
  if (::glob(pattern.c_str(), 0, nullptr, &found) == 0) {
    for (std::size_t i = 0; i < found.gl_pathc; ++i) out.emplace_back(found.gl_pathv[i]);
  }
  ::globfree(&found);
  return out;
}

class FleetReader {
 public:
  explicit FleetReader(const fs::path& file) : name_(file.string()), root_(toml_input::parse(file)) {
    fleet_.file = fs::absolute(file).lexically_normal();
  }

  Fleet read() {
    Table root({name_, "", 1}, root_);
    if (const auto verb = root.find("verb")) fleet_.verb = verb->name(verb_names, "verb");
    if (const auto rate = root.find("false_discovery_rate")) {
      fleet_.false_discovery_rate = rate->positive();
      if (fleet_.false_discovery_rate >= 1) rate->place().fail("expected a share below 1, as in 0.05");
    }
    if (auto limits = root.table("limits")) {
      set(fleet_.limits.time_s, limits->find("time_s"), as_positive);
      set(fleet_.limits.memory_mb, limits->find("memory_mb"), [](const Value& v) { return v.integer(1); });
      limits->finish();
    }
    if (const auto projects = root.find("projects")) read_projects(*projects);
    if (const auto robots = root.find("robot")) {
      if (!robots->is_list())
        robots->place().fail(
            "a fleet file has [[robot]], one for each; is this the project of a robot? Then name it in one: "
            "projects = \"cells/*/robot.toml\"");
      for (const Value& robot : robots->items()) read_robot(Table(robot));
    }
    root.finish();
    if (members_.empty())
      throw InputError(name_ + ":1: no robots: add projects = \"robots/*/robot.toml\", or [[robot]] tables");
    for (auto& [id, member] : members_) fleet_.members.push_back(std::move(member));
    check_baselines();
    return std::move(fleet_);
  }

 private:
  fs::path path(const Value& value) const {
    try {
      return (fleet_.file.parent_path() / with_home(with_variable(value.string()))).lexically_normal();
    } catch (const InputError& error) {
      value.place().fail(error.what());
    }
  }

  void read_projects(const Value& value) {
    const std::vector<Value> patterns = value.is_string() ? std::vector{value} : value.items();
    for (const Value& pattern : patterns) {
      const fs::path open = path(pattern);
      auto files = files_of(open);
      std::erase(files, fleet_.file);  // "*.toml" finds it, too
      if (files.empty())
        pattern.place().fail(fmt::format("no file '{}'; paths are relative to the fleet file", open.string()));
      for (const fs::path& file : files) add({id_of(file, open), file, {}, {}, pattern.place().line}, pattern.place());
    }
  }

  void read_robot(Table table) {
    Member member;
    member.line = table.place().line;
    member.id = table.need("id", "a name for it, as in id = \"cell_4\"").string();
    const auto project = table.find("project");
    if (const auto baseline = table.find("baseline")) {
      for (const Value& log : baseline->is_string() ? std::vector{*baseline} : baseline->items()) {
        member.baseline.push_back(path(log));
        if (!fs::is_regular_file(member.baseline.back()) && !fs::is_directory(member.baseline.back()))
          log.place().fail(
              fmt::format("no file '{}': name a log of this robot's healthy session, relative to the fleet "
                          "file",
                          member.baseline.back().string()));
      }
    }
    if (const auto overrides = table.find("overrides")) {
      toml::table keys = overrides->table();
      keys.is_inline(false);
      std::ostringstream text;
      text << keys;
      member.overrides = text.str();
    }
    table.finish();
    if (project) {
      member.project = path(*project);
      return add(std::move(member), table.place());
    }
    const auto found = members_.find(member.id);
    if (found == members_.end())
      table.place().fail("key 'project' is missing; or give the id of a robot that `projects` finds");
    member.project = found->second.project;
    found->second = std::move(member);
  }

  void add(Member member, const toml_input::Place& place) {
    if (!is_id(member.id))
      place.fail(fmt::format("id '{}': letters, digits, '_', '-' and '.' only, at most 100, a letter or digit first",
                             member.id));
    const auto [there, added] = members_.try_emplace(member.id, member);
    if (!added)
      place.fail(fmt::format("two robots have the id '{}' ({} and {}): give each a [[robot]] with an id of its own",
                             member.id, there->second.project.string(), member.project.string()));
  }

  /// A copied line is the usual way to a baseline of another robot.
  void check_baselines() const {
    std::map<fs::path, const Member*> owners;
    for (const Member& member : fleet_.members) {
      for (const fs::path& log : member.baseline) {
        const auto [owner, added] = owners.try_emplace(fs::weakly_canonical(log), &member);
        if (!added && owner->second != &member)
          throw InputError(
              fmt::format("{}:{}: robot '{}': its baseline is that of '{}', too ({}): name a log of its own; sessions "
                          "of one robot name it in their projects",
                          name_, member.line, member.id, owner->second->id, log.string()));
      }
    }
  }

  std::string name_;
  toml::table root_;
  Fleet fleet_;
  std::map<std::string, Member> members_;
};

}  // namespace

Fleet read_fleet(const fs::path& file) { return FleetReader(file).read(); }

}  // namespace fxdyn::fleet
