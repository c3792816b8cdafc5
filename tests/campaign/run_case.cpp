#include "tests/campaign/run_case.hpp"

#include <chrono>

#include "host_tools/support/files.hpp"
#include "tests/campaign/case_fleet.hpp"
#include "tests/campaign/generate.hpp"
#include "tests/campaign/score.hpp"

namespace fxdyn::campaign {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

fs::path folder_of(const Case& wanted, const RunSettings& settings) { return settings.out / "cases" / wanted.name; }
fs::path truth_of(const Case& wanted, const RunSettings& settings) { return settings.out / "truth" / wanted.name; }

/// Of a file that was written with this hash; else null.
json kept(const fs::path& file, const std::string& hash) {
  if (!fs::exists(file)) return {};
  json before = json::parse(read_file(file), nullptr, false);
  return before.is_object() && before.value("program", "") == hash ? before : json();
}

json generated(const Case& wanted, const RunSettings& settings) {
  const auto start = Clock::now();
  try {
    generate(wanted, folder_of(wanted, settings) / "data", truth_of(wanted, settings));
  } catch (const NotPossible& error) {
    return {{"status", "not_generated"}, {"message", error.what()}};
  } catch (const std::exception& error) {
    return {{"status", "failed"}, {"message", error.what()}};
  }
  return {{"truth", json::parse(read_file(truth_of(wanted, settings) / "truth.json"))},
          {"generation_s", seconds_since(start)}};
}

void add_score(json& result, const Case& wanted, const RunSettings& settings, const json& robot) {
  const auto seconds = seconds_of(settings.out, wanted.name);
  if (seconds) result["diagnosis_s"] = *seconds;
  const fs::path file = diagnosis_of(settings.out, robot);
  if (file.empty()) {
    result["status"] = "failed";
    result["message"] = robot.at("error").is_string() ? robot.at("error") : json("no diagnosis.json");
    return;
  }
  // Scoring needs the models only where a gap was to be closed; a missing one is a failure of the diagnosis.
  const auto closure = true_closure(result.at("truth"), truth_of(wanted, settings), file.parent_path());
  result["score"] = score(result.at("truth"), json::parse(read_file(file)), closure);
  result["status"] = "done";
}

}  // namespace

json earlier_result(const Case& wanted, const RunSettings& settings) {
  return kept(folder_of(wanted, settings) / "result.json", settings.program_hash + settings.own_hash);
}

json made_case(const Case& wanted, const RunSettings& settings) {
  const fs::path folder = folder_of(wanted, settings), file = folder / "case.json";
  json made = kept(file, settings.own_hash);
  if (made.is_object()) return made;
  fs::create_directories(folder);
  // Whoever kills it meanwhile leaves no case that looks whole.
  fs::remove(file);
  made = generated(wanted, settings);
  made["program"] = settings.own_hash;
  write_file(file, made.dump(1) + "\n");
  return made;
}

json scored_case(const Case& wanted, const RunSettings& settings, const json& made, const json& robot) {
  json result = made;
  if (!made.contains("status")) {
    try {
      add_score(result, wanted, settings, robot);
    } catch (const std::exception& error) {
      result["status"] = "failed";
      result["message"] = error.what();
    }
  }
  result["name"] = wanted.name;
  result["program"] = settings.program_hash + settings.own_hash;
  result["group"] = to_string(wanted.group);
  const bool passed = result.contains("score") && result["score"].value("passed", false);
  result["passed"] = passed;
  const fs::path folder = folder_of(wanted, settings);
  write_file(folder / "result.json", result.dump(1) + "\n");
  // Half a gigabyte a hundred cases: a failed one can be made again from its scenarios, but is looked at with its logs.
  if ((passed && !settings.keep) || result["status"] == "not_generated") {
    fs::remove(folder / "case.json");
    fs::remove_all(folder / "data");
    fs::remove_all(truth_of(wanted, settings));
  }
  return result;
}

}  // namespace fxdyn::campaign
