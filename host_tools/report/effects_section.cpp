#include <fmt/format.h>

#include "host_tools/effects/effects.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/effects/parameter_values.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;

namespace {

/// "coefficient = 2.25 ± 0.1 N*m*s/rad, width = 0.01 rad/s"
std::string in_words(const std::vector<ParameterValue>& parameters) {
  std::string out;
  for (const ParameterValue& p : parameters) {
    out += fmt::format("{}{} = {:.4g}{} {}", out.empty() ? "" : ", ", p.name, p.value,
                       p.std ? fmt::format(" ± {:.2g}", *p.std) : "", p.unit);
  }
  return out;
}

}  // namespace

std::string effects_section(const ReportInput& input, const nlohmann::json&) {
  Table table({{"joint"}, {"effect"}, {"side of the gearbox"}, {"torque"}, {"parameters"}});
  for (std::size_t j = 0; j < robot_of(input.fitted).size(); ++j) {
    const Joint& joint = robot_of(input.fitted).joints[j];
    const JointFit& fit = joints_of(input.fitted)[j];
    for (const EffectFit& effect : fit.effects) {
      const bool first = &effect == &fit.effects.front();
      table.add({{first ? joint.name : ""},
                 {effect.effect + (effect.named ? " (found)" : "")},
                 {std::string(effects_side)},
                 {std::string(find_effect(effect.effect)->equation)},
                 {in_words(parameter_values(effect, fit, joint.type == JointType::prismatic))}});
    }
  }
  std::string out = section("Effects") + table.html("Effects in the model");
  out += paragraph(
      "± is one standard deviation; parameters without it were searched, not estimated. Next to a kept BLS the "
      "coefficients of friction are no longer physical values of their own: both share the same torque.");
  return out;
}

}  // namespace fxdyn
