#include "host_tools/fleet/robot_result.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/files.hpp"

namespace fxdyn::fleet {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* schema = "fxdyn.fleet_robot/1";

json optional_json(const std::optional<double>& value) { return value ? json(*value) : json(); }
std::optional<double> optional_number(const json& value) {
  return value.is_number() ? std::optional(value.get<double>()) : std::nullopt;
}
json verdict_json(const std::optional<Verdict>& verdict) { return verdict ? json(to_string(*verdict)) : json(); }
std::optional<Verdict> optional_verdict(const json& value) {
  return value.is_string() ? std::optional(verdict_of(value.get<std::string>())) : std::nullopt;
}

json to_json(const std::vector<FoundEffect>& effects) {
  json out = json::array();
  for (const FoundEffect& found : effects) {
    json parameters = json::array();
    for (const NamedParameter& p : found.parameters)
      parameters.push_back({{"name", p.name}, {"unit", p.unit}, {"value", p.value}, {"std", optional_json(p.std)}});
    out.push_back({{"effect", found.effect},
                   {"certainty", found.established ? "established" : "likely"},
                   {"log10_odds_nothing", found.odds},
                   {"parameters", parameters}});
  }
  return out;
}

std::vector<FoundEffect> found_effects_of(const json& file) {
  std::vector<FoundEffect> out;
  for (const json& item : file) {
    // A number that is not finite is null in a file.
    FoundEffect found{item.at("effect"),
                      item.at("certainty") == "established",
                      optional_number(item.at("log10_odds_nothing")).value_or(0),
                      {}};
    for (const json& p : item.at("parameters"))
      found.parameters.push_back(
          {p.at("name"), p.at("unit"), optional_number(p.at("value")).value_or(0), optional_number(p.at("std"))});
    out.push_back(std::move(found));
  }
  return out;
}

std::vector<FoundEffect> found_in(const std::vector<NamedEffect>& effects) {
  std::vector<FoundEffect> out;
  out.reserve(effects.size());
  for (const NamedEffect& e : effects) out.push_back({e.effect, e.established, e.odds_nothing, e.parameters});
  return out;
}

/// Sets of which one effect is there for sure. Their odds are not in the file; these are the least that it takes
/// (diagnosis::Options).
void add_undecided(std::vector<FoundEffect>& effects, const std::vector<std::vector<std::string>>& sets) {
  constexpr double least = 3;
  for (const auto& names : sets) effects.push_back({fmt::format("{}", fmt::join(names, " or ")), true, least, {}});
}

/// Of the joints: names, units and errors, as every stage writes them.
void add_metrics(RobotState& state, const MetricsResult& metrics) {
  Role shown = Role::train;
  for (const Role role : {Role::validate, Role::test}) {
    for (const LogErrors& log : metrics.logs) shown = log.role == role ? role : shown;
  }
  state.judged_on = to_string(shown);
  if (metrics.logs.empty()) return;
  const auto& joints = metrics.logs.front().joints;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const PooledError error = pooled_error(metrics.logs, shown, j);
    state.joints.push_back({joints[j].name, joints[j].torque_unit, {}, {}, {}, {}});
    if (error.rms > 0) state.joints.back().error = error.relative();
  }
}

/// Of two tests, over the state and over time: the smaller p, times two (Bonferroni).
std::optional<double> lack_of_fit(const JointDiagnosis& joint) {
  if (!joint.state_p && !joint.time_p) return {};
  constexpr double smallest = 1e-300;  // p of what a double can hold
  const double p = std::min(joint.state_p.value_or(1), joint.time_p.value_or(1));
  return std::min(0.0, std::log10(2 * std::max(p, smallest)));
}

void add_diagnosis(RobotState& state, const DiagnosisResult& diagnosis) {
  state.verdict = diagnosis.verdict;
  state.baseline = diagnosis.baseline;
  state.notes = diagnosis.notes;
  state.on_robot = found_in(diagnosis.robot_effects);
  add_undecided(state.on_robot, diagnosis.undecided);
  if (state.joints.size() != diagnosis.joints.size()) state.joints.resize(diagnosis.joints.size());
  for (std::size_t j = 0; j < diagnosis.joints.size(); ++j) {
    const JointDiagnosis& from = diagnosis.joints[j];
    JointState& joint = state.joints[j];
    joint.joint = from.joint;
    joint.unit = from.unit;
    joint.verdict = from.verdict;
    joint.effects = found_in(from.effects);
    add_undecided(joint.effects, from.undecided);
    joint.lack_log10_p = lack_of_fit(from);
  }
}

/// Another program than fxdyn may have written it.
template <class Codec>
auto read_with(Codec codec, const fs::path& file) {
  const std::string name = file.filename().string();
  if (!fs::is_regular_file(file)) throw InputError(name + " is missing: the program did not write it");
  try {
    return codec(json::parse(read_file(file)));
  } catch (const json::exception& error) {
    throw InputError(fmt::format("{}: not as fxdyn writes it ({}): check --program", name, error.what()));
  }
}

}  // namespace

json to_json(const RobotState& state) {
  json joints = json::array();
  for (std::size_t j = 0; j < state.joints.size(); ++j) {
    const JointState& joint = state.joints[j];
    joints.push_back({{"joint", joint.joint},
                      {"index", j + 1},
                      {"unit", joint.unit},
                      {"verdict", verdict_json(joint.verdict)},
                      {"relative_error", optional_json(joint.error)},
                      {"lack_of_fit_log10_p", optional_json(joint.lack_log10_p)},
                      {"effects", to_json(joint.effects)}});
  }
  return {{"schema", schema},           {"robot", state.robot}, {"judged_on", state.judged_on},
          {"baseline", state.baseline}, {"joints", joints},     {"verdict", verdict_json(state.verdict)},
          {"notes", state.notes},       {"files", state.files}, {"robot_effects", to_json(state.on_robot)}};
}

RobotState robot_state_of(const json& file) {
  if (file.value("schema", "") != schema)
    throw InputError("result.json: another schema: remove it and start the fleet again");
  RobotState out;
  out.robot = file.at("robot");
  out.judged_on = file.at("judged_on");
  out.baseline = file.at("baseline");
  out.verdict = optional_verdict(file.at("verdict"));
  for (const json& joint : file.at("joints"))
    out.joints.push_back({joint.at("joint"), joint.at("unit"), optional_verdict(joint.at("verdict")),
                          optional_number(joint.at("relative_error")), found_effects_of(joint.at("effects")),
                          optional_number(joint.at("lack_of_fit_log10_p"))});
  out.on_robot = found_effects_of(file.at("robot_effects"));
  out.notes = file.at("notes").get<std::vector<std::string>>();
  out.files = file.at("files").get<std::vector<std::string>>();
  return out;
}

RobotState read_results_of(const fs::path& folder) {
  const fs::path out = folder / "out";
  RobotState state;
  state.robot =
      read_with([](const json& model) { return model.at("robot").at("name").get<std::string>(); }, out / "model.json");
  add_metrics(state, read_with(metrics_of, out / "metrics.json"));
  if (fs::exists(out / "diagnosis.json")) add_diagnosis(state, read_with(diagnosis_of, out / "diagnosis.json"));
  constexpr std::array shown{"out/report.html", "out/diagnosis.json", "out/metrics.json", "output.txt"};
  for (const char* file : shown) {
    if (fs::exists(folder / file)) state.files.emplace_back(file);
  }
  return state;
}

}  // namespace fxdyn::fleet
