#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "host_tools/page/page.hpp"
#include "host_tools/report/section.hpp"
#include "host_tools/report/vibration_result.hpp"

namespace fxdyn {

using namespace page;

namespace {

Cell milliseconds(double seconds) { return {fmt::format("{:.0f}", 1e3 * seconds), "n"}; }

/// Of the rows whose path is not as it was asked for.
std::string paths(const std::vector<VibrationMethod>& methods) {
  Table table({{"feedforward"},
               {"computed in"},
               {"parameters off"},
               {"path"},
               {"longer [ms]", "n"},
               {"cut short [mrad]", "n"}});
  bool any = false;
  for (const VibrationMethod& method : methods) {
    if (!method.path || method.path->delay_s.empty()) continue;
    const auto [least, most] = std::minmax_element(method.path->delay_s.begin(), method.path->delay_s.end());
    table.add({{method.feedforward},
               {method.numbers},
               {method.parameters_off},
               {method.path->kind},
               {fmt::format("{:.0f} .. {:.0f}", 1e3 * *least, 1e3 * *most), "n"},
               number(method.path->cut_short, 3)});
    any = true;
  }
  if (!any) return {};
  return subsection("Paths that take longer") + table.html("Delays of the paths") +
         paragraph(
             "Shaped: the links' path convolved with impulses that leave the model's modes at rest. It starts and ends "
             "where it did. Where it turns between two stops it is cut short. Slower: the same path in the same longer "
             "time, without a shaper.");
}

}  // namespace

std::string vibration_section(const ReportInput&, const nlohmann::json& file) {
  const VibrationResult vibration = vibration_of(file);
  const VibrationControl& control = vibration.control;
  const Cell none{"-", "n"};
  std::string out = section("Vibration");
  out += paragraph(fmt::format(
      "The scenario's robot in closed loop, gears that bend and friction on its motors, in a simulator that shares no "
      "code "
      "with the model. PD of {:.3g} Hz and damping {:.2g}, the best of a grid without feedforward; tick {:.3g} ms.",
      control.bandwidth_hz, control.damping, 1e3 * control.tick_s));
  for (const char* kind : {"all", "point_to_point", "reversals", "slow"}) {
    Table table({{"feedforward"},
                 {"computed in"},
                 {"parameters off"},
                 {"reference of"},
                 {"motor [mrad]", "n"},
                 {"link [mrad]", "n"},
                 {"residual [mrad]", "n"},
                 {"late [mrad]", "n"},
                 {"settling [ms]", "n"},
                 {"still [ms]", "n"},
                 {"roughness of rated", "n"}});
    for (const VibrationMethod& method : vibration.methods) {
      const VibrationFigures& move = method.over(kind);
      table.add({{method.feedforward},
                 {method.numbers},
                 {method.parameters_off},
                 {method.motor_side ? "motor" : "link"},
                 number(move.tracking_motor, 3),
                 number(move.tracking_link, 3),
                 number(move.residual, 3),
                 move.residual_late ? number(*move.residual_late, 3) : none,
                 milliseconds(move.settling_s),
                 move.still_s ? milliseconds(*move.still_s) : none,
                 number(move.roughness, 2)});
    }
    out += subsection(std::string("Moves: ") + kind) + table.html(std::string("Figures of moves: ") + kind);
  }
  Table ratios({{"feedforward"},
                {"computed in"},
                {"parameters off"},
                {"motor / PD alone", "n"},
                {"link / PD alone", "n"},
                {"residual / PD alone", "n"},
                {"late / PD alone", "n"},
                {"motor / rigid", "n"},
                {"link / rigid", "n"}});
  for (const VibrationMethod& method : vibration.methods) {
    const auto ratio = [&](const char* base, const char* figure) {
      const std::optional<double> value = method.ratio(base, figure);
      return value ? number(*value, 3) : none;
    };
    ratios.add({{method.feedforward},
                {method.numbers},
                {method.parameters_off},
                ratio("none", "tracking_motor"),
                ratio("none", "tracking_link"),
                ratio("none", "residual"),
                ratio("none", "residual_late"),
                ratio("rigid", "tracking_motor"),
                ratio("rigid", "tracking_link")});
  }
  out += subsection("All moves, against the PD alone and the rigid body") + ratios.html("Ratios") +
         paths(vibration.methods);
  return out + paragraph(
                   "Motor, link: RMS of the position error while it moves, the motor's against what it was asked for, "
                   "the link's against the links' reference. With the motors' reference they are asked to be ahead by "
                   "what the model says that the gears bend. Residual: how far a link is from where it "
                   "comes to rest, "
                   "at most, after the stop, mean over the joints. Settling: until every link stays within a quarter "
                   "of what it is "
                   "off at most with the PD alone. "
                   "Late, still: the same, but counted from the stop as it was asked for. Late begins when the slowest "
                   "shaped path has stopped, too. So they hold against a row that its path takes longer. "
                   "Roughness: RMS of the torque's change from tick to tick.");
}

}  // namespace fxdyn
