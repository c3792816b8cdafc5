#include <fmt/format.h>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/page/page.hpp"
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

std::string base_section(const ReportInput& input, const nlohmann::json&) {
  constexpr const char* units[] = {"kg", "kg*m", "kg*m^2"};
  Table table({{"parameter"}, {"value", "n"}, {"std", "n"}, {"std / |value|", "n"}, {"unit"}});
  for (const BaseParameter& p : base_of(input.fitted)) {
    const std::size_t kind = p.column % 10;
    const double relative = p.relative_std();
    table.add({{p.name},
               number(p.value),
               number(p.std, 2),
               {uncertainty(relative), relative > 0.3 ? "n bad" : "n"},
               {units[kind == 0  ? 0
                      : kind < 4 ? 1
                                 : 2]}});
  }
  return section("Base parameters") +
         paragraph(
             "m: mass, hx hy hz: first moment, Jxx .. Jyz: inertia about the frame's origin, of the link with that "
             "number, in "
             "modified Denavit-Hartenberg frames. Each stands for its group: what can't be told apart from it is added "
             "to it. "
             "Red: the standard deviation is above 30 % of the value, the data hardly determine it.") +
         paragraph(
             "Torques, masses, inertias and friction scale with torque_gain, errors as a share of a joint's own torque "
             "do not; a log alone can't tell the gains, a known mass can (fxdyn payload --mass).") +
         "<div class=\"split\">" + table.html("Base parameters") + "</div>\n";
}

}  // namespace fxdyn
