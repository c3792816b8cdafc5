#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host_tools/cli/verb.hpp"
#include "host_tools/effects/effects_json.hpp"

namespace fxdyn::cli {
namespace {

void print_effects(bool as_json) {
  const nlohmann::json list = effects_json();
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
