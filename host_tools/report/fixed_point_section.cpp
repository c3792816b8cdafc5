#include <fmt/format.h>

#include <cmath>

#include "host_tools/page/page.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

namespace {

std::string limits(const json& model) {
  Table table({{"joint"}, {"position"}, {"velocity", "n"}, {"acceleration", "n"}, {"torque", "n"}});
  for (const json& joint : model.at("joints")) {
    const std::string unit = text(joint.at("unit")), length = unit == "N" ? "m" : "rad";
    const json& limits = joint.at("limits");
    const auto with_unit = [&](const char* key, const std::string& of) {
      return Cell{fmt::format("{:.4g} {}", limits.at(key).get<double>(), of), "n"};
    };
    table.add({{text(joint.at("joint"))},
               {fmt::format("{:.4g} .. {:.4g} {}", limits.at("position").at(0).get<double>(),
                            limits.at("position").at(1).get<double>(), length)},
               with_unit("velocity", length + "/s"),
               with_unit("acceleration", length + "/s^2"),
               with_unit("torque", unit)});
  }
  return "<h3>Limits</h3>\n" + table.html() +
         paragraph(
             "Inputs are clamped to them. From the project file; else from the URDF where the logs come near them; "
             "else 1.2 "
             "times the largest in the train and validate logs.");
}

}  // namespace

std::string fixed_point_section(const ReportInput& input, const json& result) {
  std::string out = section("Fixed point");
  if (result.is_null()) return out + paragraph("Not exported from this model: run fxdyn export.");
  Table errors({{"joint"},
                {"unit"},
                {"observed |fixed - double|", "n"},
                {"of rated", "n"},
                {"RMS", "n"},
                {"proven at most", "n"},
                {"of rated", "n"},
                {"torque attained", "n"},
                {"proven at most", "n"}});
  for (const json& joint : result.at("joints")) {
    errors.add({{text(joint.at("joint"))},
                {text(joint.at("unit"))},
                number(joint.at("observed_max"), 3),
                {fmt::format("{:.2g}", joint.at("observed_max_of_rated").get<double>()), "n"},
                number(joint.at("quantisation_rms"), 3),
                number(joint.at("proven_bound"), 3),
                {fmt::format("{:.2g}", joint.at("proven_bound_of_rated").get<double>()), "n"},
                number(joint.at("torque_range").at("attained"), 4),
                number(joint.at("torque_range").at("proven"), 4)});
  }
  out += errors.html();
  out += paragraph(
      "Observed on the train and validate logs, on disturbed copies of them with states far beyond the limits, on "
      "random "
      "states within them and while creeping. Proven for every motion within the limits. The last two columns: the "
      "largest torque of the model that a search within the limits finds, and what it can't exceed.");
  out += paragraph(fmt::format("Tables: {} bytes. Saturated numbers on the undisturbed logs: {}.",
                               result.at("table_bytes").get<std::int64_t>(),
                               result.at("saturations_on_logs").get<std::int64_t>()));
  Table formats({{"quantity"}, {"fractional bits", "n"}, {"bits", "n"}, {"step", "n"}, {"range", "n"}});
  for (const auto& [name, value] : result.at("formats").items()) {
    const int bits = value, width = name.ends_with("_sum") ? 64 : 32;
    formats.add({{name},
                 {fmt::format("{}", bits), "n"},
                 {fmt::format("{}", width), "n"},
                 number(std::ldexp(1.0, -bits), 3),
                 {fmt::format("±{:.4g}", std::ldexp(1.0, width - 1 - bits)), "n"}});
  }
  return out + limits(input.model) + "<h3>Formats</h3>\n" + formats.html();
}

}  // namespace fxdyn
