#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "host_tools/effects/model_parts.hpp"
#include "host_tools/page/page.hpp"
#include "host_tools/report/diagnosis_words.hpp"
#include "host_tools/report/finding_pictures.hpp"
#include "host_tools/report/section.hpp"

namespace fxdyn {
namespace {

using namespace page;
namespace words = diagnosis_words;
using Eigen::Index;
using Eigen::VectorXd;

constexpr const char* data_colour = "#2e6fb7";
constexpr const char* data_cloud = "#b82e6fb7";
constexpr const char* effect_colour = "#e4572e";
constexpr const char* effect_band = "#a0e4572e";
/// Standard deviations to either side of a normal distribution's 95 %.
constexpr double deviations_of_95 = 1.96;

/// Some samples as short thin lines in their order in time: of every few strides the samples of one, as longer lines
/// would cut through what lies between. Where x jumps, as from the end of a period to its beginning, a line ends.
Trace cloud(const VectorXd& x, const VectorXd& y, Index points) {
  constexpr Index run = 4;  // points of a line
  constexpr double gap = std::numeric_limits<double>::quiet_NaN();
  const Index stride = std::max<Index>(1, (x.size() + points - 1) / points), step = (stride + run - 1) / run;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : x) {
    low = std::fmin(low, value);
    high = std::fmax(high, value);
  }
  std::vector<double> xs, ys;
  const auto add = [&](double to_x, double to_y) {
    xs.push_back(to_x);
    ys.push_back(to_y);
  };
  for (Index from = 0; from < x.size(); from += run * stride) {
    for (Index k = from; k < std::min(x.size(), from + run * step); k += step) {
      if (k > from && std::fabs(x[k] - xs.back()) > (high - low) / 2) add(x[k], gap);
      add(x[k], y[k]);
    }
    add(xs.back(), gap);
  }
  return {Eigen::Map<VectorXd>(xs.data(), static_cast<Index>(xs.size())),
          Eigen::Map<VectorXd>(ys.data(), static_cast<Index>(ys.size())),
          data_cloud,
          0.6,
          {},
          true};
}

Trace mean(const FindingPicture& of, const VectorXd& y, const char* title) {
  const ClassMeans means = class_means(of.over.x, y);
  return {means.x, means.y, data_colour, 2.2, title};
}

/// What is left without the effect, the effect's own torque with its band; and beside it what is left with the effect.
std::vector<Chart> charts_of(const FindingPicture& of, const std::string& unit, Index points) {
  const std::string left = fmt::format("residual with it [{}]", unit);
  if (of.effect.empty())
    return {{of.over.label,
             fmt::format("residual [{}]", unit),
             {cloud(of.over.x, of.with, points), mean(of, of.with, "mean")}}};
  Chart before{of.over.label, fmt::format("residual without it [{}]", unit), {cloud(of.over.x, of.without, points)}};
  if (of.band.size() > 0)
    before.curves.push_back(
        {of.torque.x, of.torque.y - of.band, effect_band, 0, "95 % band", false, of.torque.y + of.band});
  before.curves.push_back(mean(of, of.without, "data"));
  before.curves.push_back({of.torque.x, of.torque.y, effect_colour, 1.6, "effect"});
  Chart after{of.over.label, left, {cloud(of.over.x, of.with, points), mean(of, of.with, "mean")}};
  constexpr double room = 1.05;  // around the largest sample, so that both charts have one scale
  double largest = 0;
  for (const VectorXd* samples : {&of.without, &of.with}) {
    for (const double y : *samples) largest = std::isnan(y) ? largest : std::max(largest, room * std::fabs(y));
  }
  for (Chart* chart : {&before, &after}) {
    chart->y_from = -largest;
    chart->y_to = largest;
  }
  return {before, after};
}

/// A free curve with its band.
Chart chart_of(const CurveResult& curve, const std::string& unit) {
  const auto n = static_cast<Index>(curve.points.size());
  VectorXd x(n), y(n), band(n);
  for (Index i = 0; i < n; ++i) {
    const CurveResult::Point& point = curve.points[static_cast<std::size_t>(i)];
    x[i] = point.x;
    y[i] = point.y;
    band[i] = deviations_of_95 * point.std;
  }
  const std::string variable = curve.signal == "dq"     ? "velocity"
                               : curve.signal == "load" ? "load"
                               : curve.signal == "t"    ? "time"
                                                        : "position";
  const std::string of = curve.joint > 0 ? fmt::format(" of joint {}", curve.joint) : "";
  return {fmt::format("{}{} [{}]", variable, of, curve.unit),
          fmt::format("{} [{}]", curve.friction ? "friction" : "torque", unit),
          {{x, y - band, effect_band, 0, "95 % band", false, y + band}, {x, y, effect_colour, 1.6, "curve"}}};
}

std::string caption_of(const FindingPicture& of, const std::string& joint) {
  if (of.effect.empty())
    return fmt::format("{}: unknown, what no finding explains over {} ({:.0f} % of it is a function of it)", joint,
                       of.over.name, 100 * of.explained);
  return fmt::format("{}: {} over {} ({:.0f} % of its torque is a function of it){}", joint, of.effect, of.over.name,
                     100 * of.explained, of.parameters.empty() ? "" : ": " + of.parameters);
}

}  // namespace

std::string findings_section(const ReportInput& input, const nlohmann::json&) {
  const nlohmann::json& file = input.results["diagnosis"];
  const auto diagnosis = file.is_null() ? std::nullopt : std::optional(diagnosis_of(file));
  const std::vector<FindingPicture> all =
      finding_pictures(input.fitted, shown_logs(input), diagnosis ? &*diagnosis : nullptr);
  std::vector<JointDiagnosis> curved;
  if (diagnosis) {
    std::copy_if(diagnosis->joints.begin(), diagnosis->joints.end(), std::back_inserter(curved),
                 [](const JointDiagnosis& joint) { return joint.curve.has_value(); });
  }
  if (all.empty() && curved.empty()) return "";
  // Two clouds a picture, about 8 bytes a point. A curve of a chart has at most 600, with the gaps.
  constexpr Index most_points = 12'000;
  const Index points = std::clamp<Index>(most_points / std::max<Index>(1, static_cast<Index>(all.size())), 150, 400);
  const std::vector<Joint>& joints = robot_of(input.fitted).joints;
  std::vector<std::vector<Chart>> charts;
  charts.reserve(all.size() + curved.size());
  for (const FindingPicture& one : all) charts.push_back(charts_of(one, joints[one.joint].torque_unit(), points));
  for (const JointDiagnosis& joint : curved) charts.push_back({chart_of(*joint.curve, joint.unit)});
  const std::vector<std::string> pictures = draw(charts, 2);
  std::vector<std::string> shown;
  for (std::size_t i = 0; i < all.size(); ++i)
    shown.push_back(figure(pictures[i], caption_of(all[i], joints[all[i].joint].name)));
  for (std::size_t i = 0; i < curved.size(); ++i)
    shown.push_back(figure(pictures[all.size() + i], fmt::format("{}: no name, but a curve: {}", curved[i].joint,
                                                                 words::curve(*curved[i].curve))));
  std::string text = section("What was found, in pictures");
  if (!all.empty()) {
    text += paragraph(
        "Left: what the model leaves when this effect is taken out and nothing is fitted again, and the effect's "
        "own torque. Right: what is left with it. Thin lines are samples, thick ones their means. The signal is "
        "the one that tells most of the effect's torque. The band counts each parameter's standard deviation "
        "alone.");
  }
  if (!curved.empty()) text += paragraph("A curve is what one variable explains of what is left.");
  return text + figures(shown);
}

}  // namespace fxdyn
