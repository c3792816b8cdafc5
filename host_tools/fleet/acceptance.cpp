#include "host_tools/fleet/acceptance.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <nlohmann/json.hpp>

#include "host_tools/fleet/inputs.hpp"
#include "host_tools/fleet/robot_folder.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"
#include "host_tools/support/nearest.hpp"

namespace fxdyn::fleet {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* schema = "fxdyn.fleet_accepted/1";

fs::path file_of(const fs::path& directory, const std::string& id) { return directory / "accepted" / (id + ".json"); }

std::string user() {
  const passwd* entry = ::getpwuid(::geteuid());
  return entry != nullptr ? entry->pw_name : fmt::format("user {}", ::geteuid());
}

const Member& member_of(const Fleet& fleet, const std::string& id) {
  std::vector<std::string> known;
  for (const Member& member : fleet.members) {
    if (member.id == id) return member;
    known.push_back(member.id);
  }
  throw InputError(fmt::format("--accept {}: no robot of that id; nearest is '{}'", id, nearest(id, known)));
}

}  // namespace

std::optional<Acceptance> acceptance_of(const fs::path& directory, const std::string& id) {
  const fs::path file = file_of(directory, id);
  if (!fs::exists(file)) return {};
  try {
    const json content = json::parse(read_file(file));
    if (content.at("schema") == schema && content.at("id") == id)
      return Acceptance{content.at("by"), content.at("at"), robot_state_of(content.at("state"))};
  } catch (const json::exception&) {
    // said below
  }
  throw InputError(fmt::format("{}: is no accepted state of '{}': remove it, and accept today's", file.string(), id));
}

void accept(const Fleet& fleet, const fs::path& directory, const std::vector<std::string>& ids) {
  std::vector<std::string> asked = ids;
  const auto is_done = [&](const Member& member) {
    const RobotFolder folder(directory, member.id);
    try {
      return folder.is_done(inputs_of(fleet, member, folder.path()).hash);
    } catch (const InputError&) {
      return false;  // a project or a log is gone
    }
  };
  if (ids.size() == 1 && ids.front() == "all") {
    asked.clear();
    for (const Member& member : fleet.members) {
      if (is_done(member))
        asked.push_back(member.id);
      else
        fmt::print(stderr, "{}: has no result of today's logs: not accepted\n", member.id);
    }
    if (asked.empty()) throw InputError("--accept all: no robot has a result: start the fleet without --accept first");
  }
  const std::string now = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  std::vector<std::pair<fs::path, std::string>> files;
  for (const std::string& id : asked) {
    const Member& member = member_of(fleet, id);
    const RobotFolder folder(directory, id);
    if (!is_done(member))
      throw InputError(
          fmt::format("--accept {}: it has no result of today's logs: start the fleet without --accept first", id));
    const auto state = folder.result();
    const json content{{"schema", schema}, {"id", id}, {"by", user()}, {"at", now}, {"state", to_json(*state)}};
    files.emplace_back(file_of(directory, id), content.dump(1) + "\n");
  }
  for (const auto& [file, content] : files) write_file(file, content);
}

}  // namespace fxdyn::fleet
