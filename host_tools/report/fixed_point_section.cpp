#include <fmt/format.h>

#include <cmath>

#include "host_tools/effects/formats_json.hpp"
#include "host_tools/effects/model_parts.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/report/export_result.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

namespace {

std::string limits(const IdentifiedModel& model) {
  Table table({{"joint"}, {"position"}, {"velocity", "n"}, {"acceleration", "n"}, {"torque", "n"}});
  for (std::size_t j = 0; j < robot_of(model).size(); ++j) {
    const Joint& joint = robot_of(model).joints[j];
    const JointFit& fit = joints_of(model)[j];
    const std::string length = joint.position_unit();
    const auto with_unit = [](double limit, const std::string& unit) {
      return Cell{fmt::format("{:.4g} {}", limit, unit), "n"};
    };
    table.add({{joint.name},
               {fmt::format("{:.4g} .. {:.4g} {}", fit.q_lower, fit.q_upper, length)},
               with_unit(fit.dq_limit, length + "/s"),
               with_unit(fit.ddq_limit, length + "/s^2"),
               with_unit(fit.tau_limit, joint.torque_unit())});
  }
  return "<h3>Limits</h3>\n" + table.html("Limits of each joint") +
         paragraph(
             "Inputs are clamped to them. From the project file; else from the URDF where the logs come near them; "
             "else 1.2 "
             "times the largest in the train and validate logs.");
}

}  // namespace

std::string fixed_point_section(const ReportInput& input, const json& file) {
  std::string out = section("Fixed point");
  if (file.is_null()) return out + paragraph("Not exported from this model: run fxdyn export.");
  const ExportResult result = export_of(file);
  Table errors({{"joint"},
                {"unit"},
                {"observed |fixed - double|", "n"},
                {"of rated", "n"},
                {"RMS", "n"},
                {"proven at most", "n"},
                {"of rated", "n"},
                {"torque attained", "n"},
                {"proven at most", "n"}});
  for (const ExportResult::Joint& joint : result.joints) {
    errors.add({{joint.name},
                {joint.unit},
                number(joint.largest_error, 3),
                {fmt::format("{:.2g}", joint.largest_error / joint.rated_torque), "n"},
                number(joint.rms_error, 3),
                number(joint.proven_error, 3),
                {fmt::format("{:.2g}", joint.proven_error / joint.rated_torque), "n"},
                number(joint.attained_torque, 4),
                number(joint.proven_torque, 4)});
  }
  out += errors.html("Fixed point against double");
  out += paragraph(
      "Observed on the train and validate logs, on disturbed copies of them with states far beyond the limits, on "
      "random "
      "states within them and while creeping. Proven for every motion within the limits. The last two columns: the "
      "largest torque of the model that a search within the limits finds, and what it can't exceed.");
  out += paragraph(fmt::format("Tables: {} bytes. Saturated numbers on the undisturbed logs: {}.", result.table_bytes,
                               result.saturations_on_logs));
  const json bits_by_name = formats_json(result.formats);
  Table formats({{"quantity"}, {"fractional bits", "n"}, {"bits", "n"}, {"step", "n"}, {"range", "n"}});
  for (const auto& [name, value] : bits_by_name.items()) {
    const int bits = value, width = name.ends_with("_sum") ? 64 : 32;
    formats.add({{name},
                 {fmt::format("{}", bits), "n"},
                 {fmt::format("{}", width), "n"},
                 number(std::ldexp(1.0, -bits), 3),
                 {fmt::format("±{:.4g}", std::ldexp(1.0, width - 1 - bits)), "n"}});
  }
  return out + limits(input.fitted) + "<h3>Formats</h3>\n" + formats.html("Formats of numbers") +
         paragraph(
             "How each kind of number is stored: an integer of so many bits, of which the fractional ones come after "
             "the "
             "point. Step: the smallest difference it can hold. Range: the largest number, in the quantity's SI unit.");
}

}  // namespace fxdyn
