#include <fmt/format.h>

#include <algorithm>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/page/class_means.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/report/section.hpp"
#include "host_tools/report/shown_log.hpp"

namespace fxdyn {
namespace {

using namespace page;
using Eigen::Index;
using Eigen::VectorXd;

constexpr const char* line = "#2e6fb7";
constexpr const char* band = "#b82e6fb7";

/// Mean of the residual over a signal, and one standard deviation of its samples on both sides.
Chart over(const std::string& label, const VectorXd& x, const VectorXd& residual, const std::string& y_label) {
  constexpr Index classes = 60;
  const ClassMeans means = class_means(x, residual, classes);
  return {label,
          y_label,
          {{means.x, means.y - means.spread, band, 0, "one standard deviation", false, means.y + means.spread},
           {means.x, means.y, line, 2, "mean"}}};
}

std::vector<Chart> charts_of(const std::vector<ShownLog>& logs, const Joint& joint, Index k) {
  const std::string residual = fmt::format("residual [{}]", joint.torque_unit());
  const VectorXd left = joined(logs, &ShownLog::residual, k);
  const ShownLog& longest =
      *std::max_element(logs.begin(), logs.end(), [](auto& a, auto& b) { return a.t.size() < b.t.size(); });
  Chart spectrum{fmt::format("frequency [Hz] in {}", longest.log->name),
                 fmt::format("residual [{}/Hz^0.5]", joint.torque_unit()),
                 {spectrum_curve(longest.residual.col(k), *longest.log, line, "residual")},
                 true};
  for (const Trace& noise : noise_curve(*longest.log, k)) spectrum.curves.push_back(noise);
  return {over(fmt::format("velocity [{}/s]", joint.position_unit()), joined(logs, &ShownLog::dq, k), left, residual),
          over(fmt::format("position [{}]", joint.position_unit()), joined(logs, &ShownLog::q, k), left, residual),
          over(fmt::format("load [{}]", joint.torque_unit()), joined(logs, &ShownLog::load, k), left, residual),
          spectrum};
}

}  // namespace

std::string residual_section(const ReportInput& input, const nlohmann::json&) {
  const std::vector<ShownLog>& logs = shown_logs(input);
  if (logs.empty()) return "";
  const std::vector<Joint>& joints = robot_of(input.fitted).joints;
  std::vector<std::vector<Chart>> charts;
  for (std::size_t j = 0; j < joints.size(); ++j) charts.push_back(charts_of(logs, joints[j], static_cast<Index>(j)));
  const std::vector<std::string> pictures = draw(charts, 2);
  std::vector<std::string> all;
  for (std::size_t j = 0; j < joints.size(); ++j)
    all.push_back(figure(pictures[j], joints[j].name + ": residual over velocity, position, load, and its spectrum"));
  return section("What the model leaves") +
         paragraph(
             "Measured minus predicted torque of the exported model, both filtered alike, over all logs shown. Load: "
             "torque of the rigid body. A mean that bends has a cause that the model lacks; a mean of zero has none "
             "that depends on this signal alone.") +
         figures(all);
}

}  // namespace fxdyn
