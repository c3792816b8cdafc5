#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/cli/verb.hpp"
#include "host_tools/effects/effects.hpp"

namespace fxdyn::cli {
namespace {

std::string_view name_of(ActsOn acts_on) {
  switch (acts_on) {
    case ActsOn::torque:
      return "torque";
    case ActsOn::position:
      return "position";
    case ActsOn::body:
      return "body";
  }
  return "";
}

std::vector<std::string_view> confused_with(const EffectInfo& effect) {
  std::vector<std::string_view> names;
  for (const EffectInfo& other : effect_infos()) {
    if (other.name != effect.name && !telling_experiment(effect, other).empty()) names.push_back(other.name);
  }
  return names;
}

void print_effects(bool as_json) {
  nlohmann::json list = nlohmann::json::array();
  for (const EffectInfo& effect : effect_infos()) {
    nlohmann::json parameters = nlohmann::json::array();
    const auto add = [&](const auto& infos, const char* kind) {
      for (const ParameterInfo& p : infos) {
        parameters.push_back({{"name", p.name},
                              {"kind", kind},
                              {"unit", p.unit},
                              {"unit_prismatic", p.unit_prismatic},
                              {"lower", p.lower},
                              {"upper", p.upper},
                              {"source", p.source}});
      }
    };
    add(effect.shape, "shape");
    add(effect.linear, "linear");
    list.push_back({{"effect", effect.name},
                    {"words", effect.words},
                    {"equation", effect.equation},
                    {"acts_on", name_of(effect.acts_on)},
                    {"side", "joint"},
                    {"nominal", effect.nominal},
                    {"friction", effect.friction},
                    {"experiment", effect.experiments[0].text},
                    {"confused_with", confused_with(effect)},
                    {"parameters", parameters}});
  }
  if (as_json) {
    fmt::print("{}\n", list.dump(1));
    return;
  }
  for (const auto& effect : list) {
    fmt::print("{:<20} {}{}\n", effect["effect"].get<std::string>(), effect["acts_on"] == "torque" ? "tau = " : "",
               effect["equation"].get<std::string>());
    fmt::print("{:<20}   {}\n{:<20}   shown by: {}\n", "", effect["words"].get<std::string>(), "",
               effect["experiment"].get<std::string>());
    for (const auto& p : effect["parameters"]) {
      fmt::print("{:<20}   {} [{}] ({})\n", "", p["name"].get<std::string>(), p["unit"].get<std::string>(),
                 p["source"].get<std::string>());
    }
  }
}

}  // namespace

Action add_effects(CLI::App& verb) {
  const auto as_json = std::make_shared<bool>(false);
  verb.add_flag("--json", *as_json, "for machines");
  return [as_json] { print_effects(*as_json); };
}

}  // namespace fxdyn::cli
