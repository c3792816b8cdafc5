#include <fmt/format.h>

#include "host_tools/page/page.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {

using namespace page;
using nlohmann::json;

std::string vibration_section(const ReportInput&, const json& vibration) {
  const json& control = vibration.at("control");
  std::string out = section("Vibration");
  out += paragraph(fmt::format(
      "The scenario's robot in closed loop, gears that bend and friction on its motors, in a simulator that shares no "
      "code "
      "with the model. PD of {:.3g} Hz and damping {:.2g}, the best of a grid without feedforward; tick {:.3g} ms.",
      control.at("bandwidth_hz").get<double>(), control.at("damping").get<double>(),
      1e3 * control.at("tick_s").get<double>()));
  for (const char* kind : {"all", "point_to_point", "reversals", "slow"}) {
    Table table({{"feedforward"},
                 {"computed in"},
                 {"parameters off"},
                 {"reference of"},
                 {"motor [mrad]", "n"},
                 {"link [mrad]", "n"},
                 {"residual [mrad]", "n"},
                 {"settling [ms]", "n"},
                 {"roughness of rated", "n"}});
    for (const json& method : vibration.at("methods")) {
      const json& move = method.at("moves").at(kind);
      table.add({{method.at("feedforward").get<std::string>()},
                 {method.at("numbers").get<std::string>()},
                 {method.at("parameters_off").get<std::string>()},
                 {method.value("reference", "link")},
                 number(move.at("tracking_motor"), 3),
                 number(move.at("tracking_link"), 3),
                 number(move.at("residual"), 3),
                 {fmt::format("{:.0f}", 1e3 * move.at("settling_s").get<double>()), "n"},
                 number(move.at("roughness"), 2)});
    }
    out += subsection(std::string("Moves: ") + kind) + table.html();
  }
  Table ratios({{"feedforward"},
                {"computed in"},
                {"parameters off"},
                {"motor / PD alone", "n"},
                {"link / PD alone", "n"},
                {"residual / PD alone", "n"},
                {"motor / rigid", "n"},
                {"link / rigid", "n"}});
  for (const json& method : vibration.at("methods")) {
    const auto ratio = [&](const char* base, const char* key) {
      const json::json_pointer at(fmt::format("/ratios/{}/{}", base, key));
      return method.contains(at) ? number(method.at(at), 3) : Cell{"-", "n"};
    };
    ratios.add({{method.at("feedforward").get<std::string>()},
                {method.at("numbers").get<std::string>()},
                {method.at("parameters_off").get<std::string>()},
                ratio("none", "tracking_motor"),
                ratio("none", "tracking_link"),
                ratio("none", "residual"),
                ratio("rigid", "tracking_motor"),
                ratio("rigid", "tracking_link")});
  }
  out += subsection("All moves, against the PD alone and the rigid body") + ratios.html();
  return out + paragraph(
                   "Motor, link: RMS of the position error while it moves, the motor's against what it was asked for, "
                   "the link's against the links' reference. With the motors' reference they are asked to be ahead by "
                   "what the model says that the gears bend. Residual: how far a link is from where it "
                   "comes to rest, "
                   "at most, after the stop, mean over the joints. Settling: until every link stays within a quarter "
                   "of what it is "
                   "off at most with the PD alone. "
                   "Roughness: RMS of the torque's change from tick to tick.");
}

}  // namespace fxdyn
