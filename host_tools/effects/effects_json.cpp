#include "host_tools/effects/effects_json.hpp"

#include "host_tools/effects/effects.hpp"

namespace fxdyn {
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

}  // namespace

nlohmann::json effects_json() {
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
  return list;
}

}  // namespace fxdyn
