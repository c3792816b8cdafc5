#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/regression/metrics_result.hpp"
#include "host_tools/regression/physical.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;

namespace {

/// Standard deviation over value: small ones with two digits, large ones without decimals or exponents.
std::string uncertainty(double share) {
  return share > 10    ? "> 1000 %"
         : share < 0.1 ? fmt::format("{:.2g} %", 100 * share)
                       : fmt::format("{:.0f} %", 100 * share);
}

}  // namespace

namespace {

/// "-2.97 .. -0.03", the 95 % interval of a value with that standard deviation.
std::string interval(double value, double std) {
  constexpr double of_95_percent = 1.96;
  return std > 0 ? fmt::format("{:.4g} .. {:.4g}", value - of_95_percent * std, value + of_95_percent * std) : "-";
}

Cell share_cell(const BodyFigure& figure) {
  return {fmt::format("{:.0f} %", 100 * figure.data_share), figure.data_share >= determined_share ? "n good" : "n"};
}

/// Masses that give the model's torque, and how much of each the logs decided; "" where no possible body was fitted.
std::string masses(const ReportInput& input) {
  const nlohmann::json& file = input.results["metrics"];
  if (file.is_null()) return "";
  const MetricsResult metrics = metrics_of(file);
  if (!metrics.fit || !metrics.fit->physical) return "";
  const PhysicalResult& bodies = *metrics.fit->physical;
  Table table({{"link"},
               {"mass [kg]", "n"},
               {"from the data", "n"},
               {"centre x, y, z [m]", "n"},
               {"from the data", "n"},
               {"mass in the URDF [kg]", "n"}});
  const auto three = [](const std::array<BodyFigure, 3>& all, const char* format, auto value) {
    std::string out;
    for (const BodyFigure& one : all) out += (out.empty() ? "" : ", ") + fmt::format(fmt::runtime(format), value(one));
    return out;
  };
  for (const LinkResult& link : bodies.links) {
    table.add({{link.link},
               number(link.mass.value, 3),
               share_cell(link.mass),
               {three(link.centre, "{:.3g}", [](const BodyFigure& one) { return one.value; }), "n"},
               {three(link.centre, "{:.0f} %", [](const BodyFigure& one) { return 100 * one.data_share; }), "n"},
               link.urdf ? number(link.urdf->mass, 3) : Cell{"-", "n"}});
  }
  table.add({{"all links"},
             number(bodies.mass.value, 3),
             share_cell(bodies.mass),
             {"-", "n"},
             {"-", "n"},
             bodies.urdf_mass ? number(*bodies.urdf_mass, 3) : Cell{"-", "n"}});
  return subsection("Masses") +
         paragraph(fmt::format(
             "Bodies that can exist and give this model's torque; identified.urdf has them. From the data: the share "
             "that the logs decided, the rest is the prior's, {}. Green: at least {:.0f} %, a mass to rely on.",
             bodies.prior, 100 * determined_share)) +
         table.html("Masses and centres, and how much of them the data decided");
}

const char* unit_of(const BaseParameter& parameter) {
  const std::size_t kind = parameter.column % 10;
  return kind == 0 ? "kg" : kind < 4 ? "kg*m" : "kg*m^2";
}

}  // namespace

std::string base_section(const ReportInput& input, const nlohmann::json&) {
  Table table({{"parameter"}, {"value", "n"}, {"95 % interval", "n"}, {"std", "n"}, {"std / |value|", "n"}, {"unit"}});
  std::vector<BaseParameter> sorted = base_of(input.fitted);
  const auto doubt = [](const BaseParameter& p) {
    return p.value != 0 ? p.relative_std() : std::numeric_limits<double>::infinity();
  };
  std::stable_sort(sorted.begin(), sorted.end(), [&](auto& a, auto& b) { return doubt(a) < doubt(b); });
  for (const BaseParameter& p : sorted) {
    const double relative = p.relative_std();
    table.add({{p.name},
               number(p.value),
               {interval(p.value, p.std), "n"},
               number(p.std, 2),
               {uncertainty(relative), relative > 0.3 ? "n bad" : "n"},
               {unit_of(p)}});
  }
  return section("Base parameters") +
         paragraph(
             "m: mass, hx hy hz: first moment, Jxx .. Jyz: inertia about the frame's origin, of the link with that "
             "number, in "
             "modified Denavit-Hartenberg frames. Each stands for its group: what can't be told apart from it is added "
             "to it. The most certain first. Interval: 1.96 standard deviations on both sides. "
             "Red: the standard deviation is above 30 % of the value, the data hardly determine it.") +
         paragraph(
             "Torques, masses, inertias and friction scale with torque_gain, errors as a share of a joint's own torque "
             "do not; a log alone can't tell the gains, a known mass can (fxdyn payload --mass).") +
         "<div class=\"split\">" + table.html("Base parameters") + "</div>\n" + masses(input);
}

}  // namespace fxdyn
