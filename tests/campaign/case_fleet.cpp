#include "tests/campaign/case_fleet.hpp"

#include <fmt/format.h>

#include "host_tools/support/files.hpp"
#include "tests/support/run_fleet.hpp"

namespace fxdyn::campaign {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

fs::path fleet_file(const fs::path& out) { return out / "fleet.toml"; }
fs::path fleet_folder(const fs::path& out) { return out / "fleet"; }

}  // namespace

void write_fleet(const std::vector<std::string>& names, const RunSettings& settings) {
  // The fleet knows versions of fxdyn, not builds.
  const fs::path sign = fleet_folder(settings.out) / "program.txt";
  if (!fs::exists(sign) || read_file(sign) != settings.program_hash) {
    fs::remove_all(fleet_folder(settings.out));
    write_file(sign, settings.program_hash);
  }
  std::string text = fmt::format("# The campaign's cases.\n[limits]\ntime_s = {}\n", settings.time_limit_s);
  for (const std::string& name : names)
    text += fmt::format("\n[[robot]]\nid = \"{0}\"\nproject = \"cases/{0}/data/project.toml\"\n", name);
  write_file(fleet_file(settings.out), text);
}

std::map<std::string, json> run_fleet(const RunSettings& settings, const std::vector<std::string>& words) {
  const json summary = test::run_fleet(settings.program, fleet_file(settings.out), fleet_folder(settings.out), words);
  std::map<std::string, json> robots;
  for (const json& robot : summary.at("robots")) robots[robot.at("id")] = robot;
  return robots;
}

fs::path diagnosis_of(const fs::path& out, const json& robot) {
  for (const json& file : robot.at("files")) {
    fs::path path = fleet_folder(out) / file.get<std::string>();
    if (path.filename() == "diagnosis.json") return path;
  }
  return {};
}

std::optional<double> seconds_of(const fs::path& out, const std::string& name) {
  const fs::path file = fleet_folder(out) / "robots" / name / "timing.json";
  if (!fs::exists(file)) return {};
  const json timing = json::parse(read_file(file), nullptr, false);
  return timing.is_object() && timing.contains("seconds") ? std::optional(timing.at("seconds").get<double>())
                                                          : std::nullopt;
}

}  // namespace fxdyn::campaign
