#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "host_tools/cli/verb.hpp"
#include "host_tools/effects/effects_json.hpp"
#include "host_tools/support/error.hpp"
#include "host_tools/support/nearest.hpp"

namespace fxdyn::cli {
namespace {

using nlohmann::json;

/// Those of the names, in their order; all without names.
json chosen(const json& all, const std::vector<std::string>& names) {
  if (names.empty()) return all;
  json out = json::array();
  for (const std::string& name : names) {
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const json& effect) { return effect["effect"] == name; });
    if (found == all.end()) {
      std::vector<std::string> known;
      for (const json& effect : all) known.push_back(effect["effect"]);
      throw InputError(fmt::format("effects {0}: unknown effect '{0}'; nearest is '{1}'", name, nearest(name, known)));
    }
    out.push_back(*found);
  }
  return out;
}

void print_effects(const json& list) {
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
  const auto names = std::make_shared<std::vector<std::string>>();
  verb.add_option("EFFECT", *names, "only these; without: all");
  verb.add_flag("--json", *as_json, "for machines");
  return [as_json, names] {
    const json list = chosen(effects_json(), *names);
    if (*as_json)
      fmt::print("{}\n", list.dump(1));
    else
      print_effects(list);
  };
}

}  // namespace fxdyn::cli
