#include <fmt/format.h>

#include <algorithm>

#include "host_tools/report/vibration_result.hpp"

namespace fxdyn {
namespace {

std::string row(const VibrationMethod& method) {
  const VibrationFigures& all = method.all;
  const auto late = all.residual_late ? fmt::format("{:.3g}", *all.residual_late) : "-";
  const auto still = all.still_s ? fmt::format("{:.0f}", 1e3 * *all.still_s) : "-";
  const auto ratio = [&](const char* base, const char* figure) {
    const std::optional<double> value = method.ratio(base, figure);
    return value ? fmt::format(" {:>6.3f}", *value) : "      -";
  };
  return fmt::format("{:<20} {:<5} {:<6} {:>9.4g} {:>9.4g} {:>9.3g} {:>9} {:>8.0f} {:>8} {:>8.2g} |{}{}{}{} {}{}\n",
                     method.feedforward, method.numbers, method.parameters_off, all.tracking_motor, all.tracking_link,
                     all.residual, late, 1e3 * all.settling_s, still, all.roughness, ratio("none", "tracking_motor"),
                     ratio("none", "tracking_link"), ratio("none", "residual"), ratio("none", "residual_late"),
                     ratio("rigid", "tracking_motor"), ratio("rigid", "tracking_link"));
}

/// What the paths that are not as they were asked for have in common.
std::string paths(const std::vector<VibrationMethod>& methods) {
  std::string out;
  for (const VibrationMethod& method : methods) {
    if (!method.path || method.path->delay_s.empty() || !method.is_exact() || method.numbers == "real") continue;
    const auto [least, most] = std::minmax_element(method.path->delay_s.begin(), method.path->delay_s.end());
    out += fmt::format("{}: path {}, {:.0f} to {:.0f} ms longer, cut short by {:.3g} mrad at most\n",
                       method.feedforward, method.path->kind, 1e3 * *least, 1e3 * *most, method.path->cut_short);
  }
  return out;
}

}  // namespace

std::string vibration_table(const VibrationResult& result) {
  const VibrationControl& control = result.control;
  std::string out = fmt::format(
      "PD of {:.3g} Hz, damping {:.2g} (best alone), tick {:.3g} ms; means over all moves; late: from {:.0f} ms after "
      "the stop as asked for, still: since then\n",
      control.bandwidth_hz, control.damping, 1e3 * control.tick_s, 1e3 * control.late_s);
  out += fmt::format("{:<20} {:<5} {:<6} {:>9} {:>9} {:>9} {:>9} {:>8} {:>8} {:>8} | {}\n", "feedforward", "as", "off",
                     "motor mr", "link mr", "residual", "late", "settl ms", "still ms", "rough",
                     "of PD alone: motor, link, residual, late; of rigid: motor, link");
  for (const VibrationMethod& method : result.methods) out += row(method);
  out += paths(result.methods);
  for (const auto& [name, numbers] : result.fixed_against_double) {
    out += fmt::format(
        "fixed point against double in the loop ({}), of the remaining error: {:.2g} more or less, paths {:.2g} "
        "apart\n",
        name, numbers.error_change, numbers.path_difference);
  }
  return out;
}

}  // namespace fxdyn
