#include "host_tools/report/diagnosis_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <string_view>

namespace fxdyn::diagnosis_words {
namespace {

using nlohmann::json;

std::string text(const json& of, const char* key) {
  const auto found = of.find(key);
  return found != of.end() && found->is_string() ? found->get<std::string>() : "";
}

bool has_number(const json& of, const char* key) { return of.contains(key) && of.at(key).is_number(); }

struct Signal {
  std::string_view key, title, unit;  ///< unit of a revolute joint
};
// The names of diagnosis.json; what is not among them is shown as it is.
constexpr std::array signals{
    Signal{"q", "position", "rad"}, Signal{"dq", "velocity", "rad/s"}, Signal{"ddq", "acceleration", "rad/s^2"},
    Signal{"t", "time", "s"},       Signal{"load", "load", "N*m"},     Signal{"frequency", "frequency", "Hz"},
};

std::string unit_for(std::string_view revolute, const std::string& torque_unit) {
  std::string unit(revolute);
  if (torque_unit != "N") return unit;
  if (unit == "N*m") return "N";
  if (unit.starts_with("rad")) unit.replace(0, 3, "m");
  return unit;
}

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

std::string closure(const json& joint) {
  return text(joint, "verdict") == "nothing_missing" ? "-" : share(joint, "closure");
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
  const std::string values = parameters(of, plus_minus);
  return text(of, "effect") + (values.empty() ? "" : " " + values);
}

std::string where(const json& of, const std::string& torque_unit) {
  const std::string key = text(of, "signal");
  const auto known = std::find_if(signals.begin(), signals.end(), [&](const Signal& s) { return s.key == key; });
  const bool found = known != signals.end();
  const std::string name = found ? std::string(known->title) : key;
  std::string unit = text(of, "unit");
  if (unit.empty() && found) unit = unit_for(known->unit, torque_unit);
  std::string out = has_number(of, "share_of_gap") ? share(of, "share_of_gap") + " of the gap at " : "at ";
  if (key == "direction")
    return out + (has_number(of, "to") && of.at("to") > 0 ? "positive" : "negative") + " velocity";
  out += name;
  if (has_number(of, "from") && has_number(of, "to"))
    out += fmt::format(" {} .. {}{}", figure(of, "from"), figure(of, "to"), unit.empty() ? "" : " " + unit);
  else if (of.contains("value"))
    out += " " + (of.at("value").is_string() ? text(of, "value") : figure(of, "value"));
  if (of.contains("log")) out += " of " + text(of, "log");
  return out;
}

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
