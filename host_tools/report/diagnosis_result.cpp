#include "host_tools/report/diagnosis_result.hpp"

#include <fmt/format.h>

#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "host_tools/support/error.hpp"
#include "host_tools/support/json_number.hpp"

namespace fxdyn {
namespace {

using nlohmann::json;

constexpr std::array<std::pair<Verdict, std::string_view>, 5> verdict_names{
    {{Verdict::nothing_missing, "nothing_missing"},
     {Verdict::explained, "explained"},
     {Verdict::partly_explained, "partly_explained"},
     {Verdict::unexplained, "unexplained"},
     {Verdict::not_excited, "not_excited"}}};

constexpr const char* schema = "fxdyn.diagnosis/2";

std::vector<std::string> strings_of(const json& list) { return list.get<std::vector<std::string>>(); }

json to_json(const GapRegion& region) {
  json out{{"signal", region.signal},
           {"from", region.from},
           {"to", region.to},
           {"share_of_gap", or_null(region.share_of_gap)},
           {"share_of_time", or_null(region.share_of_time)}};
  if (region.joint > 0) out["joint"] = region.joint;
  if (!region.log.empty()) out["log"] = region.log;
  return out;
}

GapRegion region_of(const json& file) {
  return {file.at("signal"),        file.value("joint", std::size_t{0}),  number_of(file.at("from")),
          number_of(file.at("to")), optional_of(file.at("share_of_gap")), optional_of(file.at("share_of_time")),
          file.value("log", "")};
}

json to_json(const GapPlace& where) {
  json regions = json::array();
  for (const GapRegion& region : where.regions) regions.push_back(to_json(region));
  return {{"sentence", where.sentence}, {"regions", regions}};
}

GapPlace place_of(const json& file) {
  GapPlace out{file.at("sentence"), {}};
  for (const json& region : file.at("regions")) out.regions.push_back(region_of(region));
  return out;
}

json to_json(const std::optional<GapLeft>& left) {
  if (!left) return nullptr;
  return {{"share", left->share}, {"low", left->low}, {"high", left->high}};
}

std::optional<GapLeft> left_of(const json& file) {
  if (file.is_null()) return {};
  return GapLeft{number_of(file.at("share")), number_of(file.at("low")), number_of(file.at("high"))};
}

json to_json(const NamedEffect& effect) {
  json parameters = json::array();
  for (const NamedParameter& p : effect.parameters)
    parameters.push_back({{"name", p.name}, {"value", p.value}, {"unit", p.unit}, {"std", or_null(p.std)}});
  json out{{"effect", effect.effect},
           {"certainty", effect.established ? "established" : "likely"},
           {"log10_odds_nothing", effect.odds_nothing},
           {"log10_odds_rival", or_null(effect.odds_rival)},
           {"rival", effect.rival.empty() ? json(nullptr) : json(effect.rival)},
           {"parameters", parameters},
           {"score", effect.score},
           {"held_out_closure", or_null(effect.held_out_closure)},
           {"alternatives", effect.alternatives},
           {"model_share", effect.model_share}};
  if (!effect.signal.empty()) out["signal"] = effect.signal;
  if (effect.joints) out["joints"] = *effect.joints;
  return out;
}

NamedEffect effect_of(const json& file) {
  NamedEffect out;
  out.effect = file.at("effect");
  for (const json& p : file.at("parameters"))
    out.parameters.push_back({p.at("name"), p.at("unit"), number_of(p.at("value")), optional_of(p.at("std"))});
  out.score = number_of(file.at("score"));
  out.held_out_closure = optional_of(file.at("held_out_closure"));
  out.signal = file.value("signal", "");
  out.established = file.at("certainty") == "established";
  out.odds_nothing = number_of(file.at("log10_odds_nothing"));
  out.odds_rival = optional_of(file.at("log10_odds_rival"));
  if (file.at("rival").is_string()) out.rival = file.at("rival");
  out.alternatives = strings_of(file.at("alternatives"));
  out.model_share = number_of(file.at("model_share"));
  if (file.contains("joints")) out.joints = file.at("joints").get<std::vector<std::size_t>>();
  return out;
}

json to_json(const std::vector<NamedEffect>& effects) {
  json out = json::array();
  for (const NamedEffect& effect : effects) out.push_back(to_json(effect));
  return out;
}

std::vector<NamedEffect> effects_of(const json& list) {
  std::vector<NamedEffect> out;
  for (const json& effect : list) out.push_back(effect_of(effect));
  return out;
}

json to_json(const std::optional<CurveResult>& curve) {
  if (!curve) return nullptr;
  json x = json::array(), y = json::array(), std = json::array();
  for (const CurveResult::Point& point : curve->points) {
    x.push_back(point.x);
    y.push_back(point.y);
    std.push_back(point.std);
  }
  return {{"effect", curve->effect},
          {"signal", curve->signal},
          {"joint", curve->joint > 0 ? json(curve->joint) : json(nullptr)},
          {"unit", curve->unit},
          {"friction", curve->friction},
          {"sentence", curve->sentence},
          {"from", curve->from},
          {"to", curve->to},
          {"log10_odds_nothing", curve->odds_nothing},
          {"log10_odds_rival", or_null(curve->odds_rival)},
          {"rival", curve->rival.empty() ? json(nullptr) : json(curve->rival)},
          {"closes", curve->closes},
          {"in_model", curve->in_model},
          {"log", curve->log.empty() ? json(nullptr) : json(curve->log)},
          {"x", x},
          {"y", y},
          {"std", std}};
}

std::optional<CurveResult> curve_of(const json& file) {
  if (!file.is_object()) return {};
  CurveResult out;
  out.effect = file.at("effect");
  out.signal = file.at("signal");
  out.unit = file.at("unit");
  if (file.value("joint", json()).is_number()) out.joint = file.at("joint");
  out.friction = file.at("friction");
  out.sentence = file.at("sentence");
  out.from = number_of(file.value("from", json()));
  out.to = number_of(file.value("to", json()));
  out.odds_nothing = number_of(file.at("log10_odds_nothing"));
  out.odds_rival = optional_of(file.at("log10_odds_rival"));
  if (file.at("rival").is_string()) out.rival = file.at("rival");
  out.closes = number_of(file.at("closes"));
  out.in_model = file.at("in_model");
  if (file.value("log", json()).is_string()) out.log = file.at("log");
  for (std::size_t i = 0; i < file.at("x").size(); ++i)
    out.points.push_back(
        {number_of(file.at("x").at(i)), number_of(file.at("y").at(i)), number_of(file.at("std").at(i))});
  return out;
}

json to_json(const JointDiagnosis& joint) {
  return {{"joint", joint.joint},
          {"index", joint.index},
          {"unit", joint.unit},
          {"verdict", to_string(joint.verdict)},
          {"gap_before", or_null(joint.gap_before)},
          {"gap_after", or_null(joint.gap_after)},
          {"noise_floor", or_null(joint.noise_floor)},
          {"gate_before", or_null(joint.gate_before)},
          {"gate_after", or_null(joint.gate_after)},
          {"carries_over", joint.carries_over ? json(*joint.carries_over) : json(nullptr)},
          {"closure", or_null(joint.closure)},
          {"left", to_json(joint.left)},
          {"where", to_json(joint.where)},
          {"effects", to_json(joint.effects)},
          {"undecided", joint.undecided},
          {"curve", to_json(joint.curve)},
          {"not_identifiable", joint.not_identifiable},
          {"lack_of_fit", {{"state_p", or_null(joint.state_p)}, {"time_p", or_null(joint.time_p)}}}};
}

JointDiagnosis joint_of(const json& file) {
  JointDiagnosis out;
  out.joint = file.at("joint");
  out.index = file.at("index");
  out.unit = file.at("unit");
  out.verdict = verdict_of(file.at("verdict").get<std::string>());
  out.gap_before = optional_of(file.at("gap_before"));
  out.gap_after = optional_of(file.at("gap_after"));
  out.noise_floor = optional_of(file.at("noise_floor"));
  // Files of earlier versions don't have these three.
  out.gate_before = optional_of(file.value("gate_before", json()));
  out.gate_after = optional_of(file.value("gate_after", json()));
  if (const json over = file.value("carries_over", json()); over.is_boolean()) out.carries_over = over.get<bool>();
  out.closure = optional_of(file.at("closure"));
  out.left = left_of(file.at("left"));
  out.where = place_of(file.at("where"));
  out.effects = effects_of(file.at("effects"));
  out.undecided = file.at("undecided");
  out.curve = curve_of(file.value("curve", json()));  // files of earlier versions have none
  out.not_identifiable = strings_of(file.at("not_identifiable"));
  const json& lack = file.at("lack_of_fit");
  out.state_p = optional_of(lack.at("state_p"));
  out.time_p = optional_of(lack.at("time_p"));
  return out;
}

}  // namespace

std::string_view to_string(Verdict verdict) {
  for (const auto& [one, name] : verdict_names) {
    if (one == verdict) return name;
  }
  return {};
}

Verdict verdict_of(std::string_view name) {
  for (const auto& [one, its_name] : verdict_names) {
    if (its_name == name) return one;
  }
  throw InputError(fmt::format("diagnosis.json: unknown verdict '{}': run `fxdyn diagnose` again", name));
}

json to_json(const DiagnosisResult& result) {
  json joints = json::array();
  for (const JointDiagnosis& joint : result.joints) joints.push_back(to_json(joint));
  json out{{"schema", schema},
           {"verdict", to_string(result.verdict)},
           {"joints", joints},
           {"robot_effects", to_json(result.robot_effects)},
           {"undecided", result.undecided},
           {"not_identifiable", result.not_identifiable},
           {"next_experiment", result.next_experiment},
           {"gate", result.gate},
           {"figures_on", result.figures_on},
           {"baseline", result.baseline},
           {"notes", result.notes}};
  if (result.evidence) out["evidence"] = to_json(*result.evidence);
  return out;
}

DiagnosisResult diagnosis_of(const json& file) {
  if (file.value("schema", "") != schema)
    throw InputError(fmt::format("diagnosis.json: schema '{}', expected '{}': run `fxdyn diagnose` again",
                                 file.value("schema", ""), schema));
  DiagnosisResult out;
  out.verdict = verdict_of(file.at("verdict").get<std::string>());
  for (const json& joint : file.at("joints")) out.joints.push_back(joint_of(joint));
  out.robot_effects = effects_of(file.at("robot_effects"));
  out.undecided = file.at("undecided");
  out.not_identifiable = strings_of(file.at("not_identifiable"));
  out.next_experiment = file.at("next_experiment");
  out.gate = file.at("gate");
  out.figures_on = file.at("figures_on");
  out.baseline = file.at("baseline");
  out.notes = strings_of(file.at("notes"));
  if (file.contains("evidence")) out.evidence = evidence_of(file.at("evidence"));
  return out;
}

}  // namespace fxdyn
