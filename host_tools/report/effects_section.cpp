#include <fmt/format.h>

#include "host_tools/page/page.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

std::string effects_section(const ReportInput& input, const json&) {
  Table table({{"joint"}, {"effect"}, {"side of the gearbox"}, {"torque"}, {"parameters"}});
  for (const json& joint : input.model.at("joints")) {
    for (const json& effect : joint.at("effects")) {
      std::string parameters;
      for (const json& p : effect.at("parameters")) {
        parameters += fmt::format(
            "{}{} = {:.4g}{} {}", parameters.empty() ? "" : ", ", text(p.at("name")), p.at("value").get<double>(),
            p.contains("std") ? fmt::format(" ± {:.2g}", p.at("std").get<double>()) : "", text(p.at("unit")));
      }
      const bool first = &effect == &joint.at("effects").front();
      table.add({{first ? text(joint.at("joint")) : ""},
                 {text(effect.at("effect")) + (effect.at("origin") == "named" ? " (found)" : "")},
                 {text(effect.at("side"))},
                 {text(effect.at("equation"))},
                 {parameters}});
    }
  }
  std::string out = section("Effects") + table.html("Effects in the model");
  out += paragraph(
      "± is one standard deviation; parameters without it were searched, not estimated. Next to a kept BLS the "
      "coefficients of friction are no longer physical values of their own: both share the same torque.");
  return out;
}

}  // namespace fxdyn
