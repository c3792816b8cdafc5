#include "host_tools/report/diagnosis_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace fxdyn::diagnosis_words {
namespace {

using nlohmann::json;

std::string text(const json& of, const char* key) {
  const auto found = of.find(key);
  return found != of.end() && found->is_string() ? found->get<std::string>() : "";
}

bool has_number(const json& of, const char* key) { return of.contains(key) && of.at(key).is_number(); }

}  // namespace

std::string verdict(const json& of) {
  std::string words = text(of, "verdict");
  std::replace(words.begin(), words.end(), '_', ' ');
  return words.empty() ? "-" : words;
}

std::string figure(const json& of, const char* key) {
  return has_number(of, key) ? fmt::format("{:.3g}", of.at(key).get<double>()) : "-";
}

std::string share(const json& of, const char* key) {
  return has_number(of, key) ? fmt::format("{:.0f} %", 100 * of.at(key).get<double>()) : "-";
}

std::string left(const json& joint) {
  const json of = joint.value("left", json());
  if (!of.is_object() || !has_number(of, "share")) return "-";
  return fmt::format("{} ({:.0f} .. {:.0f})", share(of, "share"), 100 * of.value("low", 0.0),
                     100 * of.value("high", 0.0));
}

std::string certainty(const json& effect) {
  const std::string rival = text(effect, "rival");
  const bool closer = has_number(effect, "log10_odds_rival") && has_number(effect, "log10_odds_nothing") &&
                      effect.at("log10_odds_rival") < effect.at("log10_odds_nothing");
  const char* key = closer ? "log10_odds_rival" : "log10_odds_nothing";
  if (!has_number(effect, key)) return text(effect, "certainty");
  return fmt::format("{}: 10^{:.0f} to 1 against {}", text(effect, "certainty"), effect.at(key).get<double>(),
                     closer ? rival : "nothing");
}

std::string either(const json& names) {
  std::string out;
  for (const json& name : names) {
    if (name.is_string()) out += (out.empty() ? "" : " or ") + name.get<std::string>();
  }
  return out;
}

std::string parameters(const json& of, const char* plus_minus) {
  std::string out;
  for (const json& p : of.value("parameters", json::array())) {
    const std::string unit = text(p, "unit");
    const bool known = has_number(p, "std") && p.at("std") > 0;
    out += fmt::format("{}{} {}{}{}", out.empty() ? "" : ", ", text(p, "name"), figure(p, "value"),
                       known ? fmt::format("{}{:.2g}", plus_minus, p.at("std").get<double>()) : "",
                       unit.empty() || unit == "-" ? "" : " " + unit);
  }
  return out;
}

std::string effect(const json& of, const char* plus_minus) {
  const std::string values = parameters(of, plus_minus), likely = text(of, "certainty") == "likely" ? "likely " : "";
  return likely + text(of, "effect") + (values.empty() ? "" : " " + values);
}

std::string where(const json& joint) { return text(joint.value("where", json::object()), "sentence"); }

std::string list(const json& of) {
  std::string out;
  for (const json& item : of) {
    std::string name = item.is_string() ? item.get<std::string>() : "";
    if (item.is_object()) name = effect(item, "+-");
    if (item.is_number()) name = item.dump();
    if (item.is_array()) name = list(item);
    if (!name.empty()) out += (out.empty() ? "" : ", ") + name;
  }
  return out;
}

std::string joint(const json& of, std::size_t place) {
  const std::string name = text(of, "joint");
  return name.empty() ? fmt::format("joint {}", of.value("index", place + 1)) : name;
}

std::string not_borne_out(const json& diagnosis) {
  std::string out;
  const json joints = diagnosis.value("joints", json::array());
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const json& of = joints[j];
    if (of.value("carries_over", json()) != false) continue;
    out += fmt::format("{}{} ({} -> {} {}; {} -> {} on the gate data)", out.empty() ? "" : ", ", joint(of, j),
                       figure(of, "gap_before"), figure(of, "gap_after"), of.value("unit", ""),
                       figure(of, "gate_before"), figure(of, "gate_after"));
  }
  return out;
}

std::string figures_on(const json& diagnosis) {
  std::string out = text(diagnosis, "figures_on");
  if (const std::string gate = text(diagnosis, "gate"); !out.empty() && !gate.empty() && gate != out)
    out += "; closed: on " + gate;
  if (diagnosis.value("baseline", false))
    out += out.empty() ? "change since the baseline" : "; change since the baseline";
  return out;
}

std::string next_experiment(const json& diagnosis) {
  std::vector<std::string> sentences;
  const auto add = [&](const json& of) {
    const std::string sentence = text(of, "next_experiment");
    if (!sentence.empty() && std::find(sentences.begin(), sentences.end(), sentence) == sentences.end())
      sentences.push_back(sentence);
  };
  add(diagnosis);
  for (const json& one : diagnosis.value("joints", json::array())) add(one);
  std::string out;
  for (const std::string& sentence : sentences) out += (out.empty() ? "" : "; ") + sentence;
  return out;
}

}  // namespace fxdyn::diagnosis_words
